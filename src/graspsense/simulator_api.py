"""What only simulators and compiled code need, besides `graspsense.plugin_api`."""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames

PUBLIC: Final = LazyNames(__name__)

__all__ = PUBLIC.names
