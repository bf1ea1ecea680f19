"""What some grippers need besides `graspsense.plugin_api`: calibration, clocks, more fingers, emulated devices."""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames

PUBLIC: Final = LazyNames(__name__)

__all__ = PUBLIC.names
