"""Choices that trial grasps have checked, kept on disk from one process to the next.

A choice follows from the settings, the object and the controller, and from the code that makes it. All of that is in
the mark it is kept under, so that what was made by other code is never found. What cannot be read is made anew.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

from attrs import asdict

import graspsense.plugin_api as plugin_api
from graspsense.plugin_api import NotCompilable, cache_folder, fingerprint
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.plant import Steps
from graspsense_sim_gripper.selection import Check, Choice, Decision
from graspsense_sim_gripper.terms.registry import laws_of
from graspsense_sim_gripper.terms.term import WorkingPoint

MOST: Final = 4000
"""Files of some 2 kB; where there are more the older half goes."""


def mark_of(spec: ObjectSpec, step: Any, *settings: Any) -> str | None:
    """Return what a choice is kept under: a mark of the object, a controller's step, the settings, and all their code.

    None where the code of a term or of the controller cannot be told from other code.
    """
    digest = hashlib.sha256(_own_code())
    functions = (step, *laws_of(spec.kinds))
    try:
        marks = [fingerprint(one) for one in functions]
        # Beside its law a term says how fast it is, and what may stand for it.
        stamps = [_stamp(Path(str(sys.modules[one.__module__].__file__))) for one in functions]
    except (NotCompilable, KeyError, AttributeError, OSError):
        return None
    for item in (repr(spec), *map(repr, settings), *marks, *stamps):
        digest.update(item.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]


@cache
def _own_code() -> bytes:
    """Return a mark of our own code as it stands on disk."""
    packages = (Path(__file__).parent.parent, Path(plugin_api.__file__).parent / "core")
    return "".join(_stamp(source) for one in packages for source in sorted(one.rglob("*.py"))).encode()


def _stamp(source: Path) -> str:
    found = source.stat()
    return f"{source} {found.st_size} {found.st_mtime_ns}\n"


def find(mark: str) -> Choice | None:
    """Return the choice that is kept under this mark, if one is."""
    folder = _folder()
    if folder is not None:
        with suppress(OSError, ValueError, TypeError, KeyError):
            return _choice(json.loads((folder / f"{mark}.json").read_text(encoding="utf-8")))
    return None


def keep(mark: str, choice: Choice) -> None:
    """Keep a choice under this mark, where that can be written."""
    folder = _folder()
    if folder is None:
        return
    with suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        _make_room(folder)
        # Whole or not at all, whoever else writes the same.
        with tempfile.NamedTemporaryFile("w", dir=folder, suffix=".part", delete=False) as part:
            try:
                json.dump(_plain(choice), part)
                part.close()
                os.replace(part.name, folder / f"{mark}.json")
            except BaseException:
                os.unlink(part.name)
                raise


def _folder() -> Path | None:
    kept = cache_folder()
    return None if kept is None else kept / "choices"


def _make_room(folder: Path) -> None:
    files = list(folder.iterdir())
    if len(files) < MOST:
        return
    for path in sorted(files, key=lambda path: path.stat().st_mtime)[: len(files) // 2]:
        path.unlink(missing_ok=True)


def _plain(choice: Choice) -> dict[str, Any]:
    values = asdict(choice, recurse=True)
    return {**values, "point": choice.point._asdict(), "steps": choice.steps._asdict()}


def _choice(values: dict[str, Any]) -> Choice:
    check = values["check"]
    return Choice(
        **{
            **values,
            "made": tuple(values["made"]),
            "point": WorkingPoint(**values["point"]),
            "steps": Steps(**values["steps"]),
            "decisions": tuple(Decision(**one) for one in values["decisions"]),
            "scheme": Decision(**values["scheme"]),
            "contact": Decision(**values["contact"]),
            "check": None if check is None else Check(**check),
        }
    )
