"""What every plugin may import from graspsense: 70 names, in groups by their use.

What few plugins need is in `graspsense.gripper_api`, `classifier_api`, `experiment_api`, `simulator_api` and
`testing_api`.

A name is imported when it is first used. The entry module of a plugin, which is all that listing plugins imports,
therefore loads neither numpy nor a driver. The names stand in `plugin_api.pyi`, which type checkers read too.
"""

from __future__ import annotations

from typing import Any, Final

from graspsense.core.components.lazy_names import LazyNames

PUBLIC: Final = LazyNames(__name__)

__all__ = PUBLIC.names


def __getattr__(name: str) -> Any:
    # An import statement asks for __path__, of a module that is no package too.
    if name not in PUBLIC.names and not name.startswith("__"):
        from graspsense.core.components.moved_names import refuse_moved

        refuse_moved(name)
    return PUBLIC.load(name)
