"""Trials of identified objects: `identified:cup.toml,mug.toml` simulates squeezes of scenes of `graspsense identify`.

Instances and placements are drawn from the identified spreads. The label of a trial is that of the recordings.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from attrs import frozen

from graspsense.core.components.caller import option
from graspsense.core.settings.layers import Flag, read_toml
from graspsense.core.values.errors import ConfigError

IDENTIFIED: Final = "identified:"


@frozen(kw_only=True)
class IdentifiedScene:
    """A scene file that recordings were identified as: its label, and settings of the gripper they were made with."""

    path: str
    label: str
    gripper: Mapping[str, float]


def identified_scenes(source: str) -> tuple[IdentifiedScene, ...]:
    """Return the scenes that `identified:FILE.toml,...` names.

    Raises ConfigError if a file was not written by `graspsense identify`, if two have one label, or if they were
    recorded with different fingertips.
    """
    names = [name.strip() for name in source.removeprefix(IDENTIFIED).split(",") if name.strip()]
    if not names:
        raise ConfigError(f"{source!r} names no scene: write identified:cup.toml,mug.toml")
    scenes = tuple(_scene(name) for name in names)
    labels = [scene.label for scene in scenes]
    for scene in scenes:
        if labels.count(scene.label) > 1:
            both = ", ".join(twin.path for twin in scenes if twin.label == scene.label)
            raise ConfigError(f"{both} have the same label {scene.label!r}: name one scene for each label")
        if scene.gripper != scenes[0].gripper:
            raise ConfigError(
                f"{scene.path} and {scenes[0].path} were identified with different fingertips ([identified.gripper]): "
                "their squeezes cannot be compared"
            )
    return scenes


def gripper_flags(source: str) -> list[Flag]:
    """Return the settings of the gripper that the scenes of a source were recorded with; none for another source."""
    if not source.startswith(IDENTIFIED):
        return []
    return [
        Flag(source, f"gripper.{key}", value) for key, value in identified_scenes(source)[0].gripper.items()
    ]


def _scene(name: str) -> IdentifiedScene:
    path = Path(os.path.expanduser(name))
    if not path.exists():
        raise ConfigError(f"there is no scene {name}")
    table = read_toml(path, name, "scene").values
    identified: Any = table.get("identified")
    gripper = identified.get("gripper", {}) if isinstance(identified, dict) else None
    if not isinstance(gripper, dict):
        raise ConfigError(
            f"{name} has no table [identified]: `graspsense identify` writes it. Scenes of your own are simulated by "
            f"the source `simulated` with {option('objects', name)}"
        )
    for key, value in gripper.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"{name}: identified.gripper.{key}: {value!r} is not a number")
    numbers = {str(key): float(value) for key, value in gripper.items()}
    return IdentifiedScene(path=str(path), label=str(identified.get("label") or path.stem), gripper=numbers)
