"""Finding and loading plugins, isolating those that fail, and selecting a component by role and name.

- `parts`: what a plugin brings and declares, as the registry holds it.
- `discovery`: which plugins are installed, and which may be loaded.
- `isolation`: one plugin at a time, when it is loaded and when its hooks are called.
- `plugins`: the plugins of a process.
"""

from graspsense.core.components.registry.discovery import PluginSource, builtin_source, installed_sources
from graspsense.core.components.registry.isolation import HEAVY, SLOW_IMPORT_S
from graspsense.core.components.registry.parts import (
    Component,
    HookAnswer,
    PluginStatus,
    Resource,
    canonical,
)
from graspsense.core.components.registry.plugins import IsolatedPlugins, Plugins, collect, installed

__all__ = [
    "HEAVY",
    "SLOW_IMPORT_S",
    "Component",
    "HookAnswer",
    "IsolatedPlugins",
    "PluginSource",
    "PluginStatus",
    "Plugins",
    "Resource",
    "builtin_source",
    "canonical",
    "collect",
    "installed",
    "installed_sources",
]
