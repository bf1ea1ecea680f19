"""The cache of chosen steps, in memory and on disk.

A choice depends on the settings, the object and the controller, and on the code of the simulator, the terms and the
controller. In memory the key holds the settings, the object and the controller. On disk the key is a digest of these
and of the code, so that a choice is never used with other code. A file that cannot be read is ignored.
"""

from __future__ import annotations

import hashlib
import json
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import cattrs

import graspsense.plugin_api as plugin_api
from graspsense.plugin_api import FeatureSet
from graspsense.simulator_api import (
    NotCompilable,
    cache_folder,
    fingerprint,
    is_closed,
    make_closed,
    write_whole,
)
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.levels import Level
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.problem import ControllerStep, GraspController
from graspsense_sim_gripper.scene.terms.registry import active_laws
from graspsense_sim_gripper.scene.terms.term import OnSum
from graspsense_sim_gripper.solve.scheme import Steps

MAX_IN_MEMORY: Final = 512
"""Choices in memory, of some 5 kB each; at that number all are dropped."""
MAX_FILES: Final = 4000
"""Files on disk, of some 2 kB each; at that number the older half is deleted."""
_CONTENT: Final = "files with choices of models"

Json = Any
"""A value that JSON can represent."""


class Key(NamedTuple):
    """Everything that a choice depends on, except the code."""

    config: SimConfig
    kinds: tuple[str, ...]
    """The kinds of the object's terms."""
    spec: str
    """`ObjectSpec.content`."""
    step: ControllerStep
    controller: str
    """`GraspController.content`."""
    features: str
    """The feature set with its settings and its files; empty if there is none."""


_IN_MEMORY: Final[dict[Key, ChosenSteps]] = {}


def key_of(problem: Problem, controller: GraspController) -> Key:
    """Return the key of the choice for a problem under a controller. Raises TypeError if there is no object."""
    spec = problem.spec
    if spec is None:
        raise TypeError("where there is no object there are no steps to choose")
    return Key(
        config=problem.model_config,
        kinds=spec.kinds,
        spec=spec.content,
        step=controller.step,
        controller=controller.content,
        features=_features_content(controller.features),
    )


def find(key: Key) -> ChosenSteps | None:
    """Return the choice of this key, from memory or else from disk; None if there is none."""
    chosen = _IN_MEMORY.get(key)
    if chosen is None and (path := _file_of(key)) is not None and (chosen := _read(path)) is not None:
        _remember(key, chosen)
    return chosen


def keep(key: Key, chosen: ChosenSteps) -> None:
    """Keep a choice: in memory, and on disk if it was verified by trial grasps and a file can be written."""
    _remember(key, chosen)
    path = None if chosen.verification is None else _file_of(key)
    if path is None:
        return
    with suppress(OSError):
        _delete_old_files(path.parent)
        values = json.loads(json.dumps(stored(chosen)))
        content = json.dumps({"model": values, "sha256": _digest(values)})
        write_whole(path, content.encode(), mode=0o600)


def forget() -> None:
    """Remove the choices in memory; those on disk remain."""
    _IN_MEMORY.clear()


def _remember(key: Key, chosen: ChosenSteps) -> None:
    if len(_IN_MEMORY) >= MAX_IN_MEMORY:
        forget()
    _IN_MEMORY[key] = chosen


def _file_of(key: Key) -> Path | None:
    """Return the file of a choice, named by a digest of its key and of all code that it depends on.

    None if the code of a term or of the controller cannot be identified, or without a folder that is closed to other
    users.
    """
    parent = cache_folder()
    if parent is None:
        return None
    functions = (key.step, *(law.law if isinstance(law, OnSum) else law for law in active_laws(key.kinds)))
    try:
        make_closed(parent / "chosen_steps")
        marks = [fingerprint(function) for function in functions]
        # The rates and limits of a term are in the same file as its law: the file is identified as well.
        stamps = [_stamp(Path(str(sys.modules[function.__module__].__file__))) for function in functions]
    except (NotCompilable, KeyError, AttributeError, OSError):
        return None
    items = (key.spec, repr(key.config), key.controller, key.features, *marks, *stamps)
    name = hashlib.sha256(_own_code() + "\0".join(items).encode()).hexdigest()[:32]
    folder = parent / "chosen_steps"
    return folder / f"{name}.json" if is_closed(folder, _CONTENT) else None


@cache
def _own_code() -> bytes:
    """Return text that identifies the files of the simulator and of the core: their paths, sizes and times."""
    packages = (Path(__file__).parents[2], Path(plugin_api.__file__).parent / "core")
    return "".join(_stamp(source) for folder in packages for source in sorted(folder.rglob("*.py"))).encode()


def _features_content(feature_set: FeatureSet[Any] | None) -> str:
    """Return text that identifies a feature set: its class, its settings, and the files in the folder of its code."""
    if feature_set is None:
        return ""
    kind = type(feature_set)
    return f"{kind.__module__}.{kind.__qualname__} {feature_set.config!r} {_folder_of(kind)}"


@cache
def _folder_of(kind: type) -> str:
    source = getattr(sys.modules.get(kind.__module__), "__file__", None)
    if source is None:
        return ""
    with suppress(OSError):
        return "".join(_stamp(path) for path in sorted(Path(source).parent.glob("*.py")))
    return ""


def _stamp(source: Path) -> str:
    status = source.stat()
    return f"{source} {status.st_size} {status.st_mtime_ns}\n"


def _read(path: Path) -> ChosenSteps | None:
    if not path.is_file() or not is_closed(path, _CONTENT):
        return None
    with suppress(OSError, ValueError, TypeError, KeyError):
        kept = json.loads(path.read_text(encoding="utf-8"))
        # A choice that was edited would change what is simulated, and nothing else would tell.
        if kept["sha256"] == _digest(kept["model"]):
            return restored(kept["model"])
    return None


def _digest(values: Json) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


def _delete_old_files(folder: Path) -> None:
    files = list(folder.iterdir())
    if len(files) < MAX_FILES:
        return
    for path in sorted(files, key=lambda path: path.stat().st_mtime)[: len(files) // 2]:
        path.unlink(missing_ok=True)


def stored(model: ChosenSteps) -> Json:
    """Return a model as values that JSON can represent."""
    return _CONVERTER.unstructure(model)


def restored(values: Json) -> ChosenSteps:
    """Return the model of which `stored` has given these values.

    Raises KeyError, TypeError or ValueError for others.
    """
    return _CONVERTER.structure(values, ChosenSteps)


_CONVERTER: Final = cattrs.Converter(detailed_validation=False)
for _kind in (Steps, Level):
    # Their numbers in order: not all versions of cattrs know named tuples.
    _CONVERTER.register_structure_hook(_kind, lambda values, kind: kind(*values))
