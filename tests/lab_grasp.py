"""A grasp with the parts that a test module declares as a plugin, as it is kept in a store."""

import sys
from contextlib import contextmanager

import pytest

from graspsense import load_pipeline
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store


@contextmanager
def recorded_grasp(module, plugin, folder, *options, others=()):
    """Grasp with these options, and yield what was kept, the path of its recording, and the plugins.

    `plugin` offers parts of the module; `others` are further plugins, each with the name of its distribution.
    """
    with pytest.MonkeyPatch.context() as patch, IsolatedPlugins() as plugins, Store.open(folder) as store:
        patch.setitem(sys.modules, module.__name__, module)
        for added, distribution in (*others, (plugin, "lab-hand")):
            plugins.add(added, distribution)
        settings = load_pipeline(options=[*options, "classifier.type=none"], plugins=plugins).settings
        kept = record_grasp(store, settings, plugins, labels={}, origin="run")
        (path,) = (folder / "recordings").glob("*.mcap")
        yield kept, path, plugins
