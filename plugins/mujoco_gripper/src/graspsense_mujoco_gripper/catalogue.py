"""The things that can be grasped: a catalogue of MJCF fragments, and files of users."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Final

from attrs import frozen

from graspsense.plugin_api import UnknownName, structured, suggestion, toml_values

FOLDER: Final = Path(str(files("graspsense_mujoco_gripper") / "things"))


@frozen(kw_only=True)
class Thing:
    """A thing: what it is, and the force (N) at which the equalities of its shell are switched off."""

    summary: str = ""
    breaks_at_n: float = float("inf")
    shell: tuple[str, ...] = ()


@lru_cache(maxsize=1)
def catalogue() -> Mapping[str, Thing]:
    """Return the things that come with this package, by name."""
    values = toml_values((FOLDER / "things.toml").read_text(encoding="utf-8"))
    return {name: structured(table, Thing, name) for name, table in values.items()}


def thing_named(name: str) -> tuple[Thing, Path | None]:
    """Return a thing and its MJCF file; no file for `none`. What follows `#` is ignored. Raises UnknownName."""
    name = name.partition("#")[0]
    if name == "none":
        return Thing(), None
    if name.endswith(".xml"):
        path = Path(name).expanduser()
        if not path.is_file():
            raise UnknownName(f"gripper.object: there is no file {path}")
        return Thing(summary=path.stem), path
    if name not in catalogue():
        raise UnknownName(
            f"gripper.object: there is no thing {name!r}. Known: {', '.join(catalogue())}, none, or an MJCF file "
            f"(.xml).{suggestion(name, catalogue())}"
        )
    return catalogue()[name], FOLDER / f"{name}.xml"
