"""graspsense: recognise an object and its state from the forces while a gripper closes on it.

These are the names for users. A name is imported when it is first used; importing graspsense loads no plugin.
"""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames
from graspsense.core.values.display import drawn_by

__version__: Final = "0.1.0"

drawn_by("graspsense.report.notebook")

PUBLIC: Final = LazyNames(__name__)

__all__ = ["__version__", *PUBLIC.names]
