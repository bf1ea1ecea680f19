"""What every plugin may import from graspsense: 70 names, in groups by their use.

What few plugins need is in `graspsense.gripper_api`, `classifier_api`, `experiment_api`, `simulator_api` and
`testing_api`.

A name is imported when it is first used. The entry module of a plugin, which is all that listing plugins imports,
therefore loads neither numpy nor a driver. The names stand in `plugin_api.pyi`, which type checkers read too.
"""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames

PUBLIC: Final = LazyNames(__name__)

__all__ = PUBLIC.names
