"""What a plugin with kinds of experiments may import, besides `graspsense.plugin_api`.

A kind computes its tasks from a source of trials, and reports a `Summary` of their results as `Findings`.
"""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames

PUBLIC: Final = LazyNames(__name__)

__all__ = PUBLIC.names
