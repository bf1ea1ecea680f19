"""What a setting means for the result of a grasp, as the field of its config class declares it.

A component states this in the attrs metadata of the field:

    explain: bool = field(default=False, metadata=CHANGES_NO_RESULT)
    object: str = field(default="block", metadata=NAMES_INPUT)

A setting without either is part of the set-up: two grasps that differ in it are not comparable.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from attrs import fields, has

_MEANING: Final = "graspsense.meaning"

CHANGES_NO_RESULT: Final[Mapping[str, Any]] = {_MEANING: "changes no result"}
"""Metadata of a setting that changes what is reported, or how fast, but not the result beyond its stated accuracy."""
NAMES_INPUT: Final[Mapping[str, Any]] = {_MEANING: "names an input"}
"""Metadata of a setting that names what is grasped, replayed or loaded: it differs from run to run."""


def settings_marked(config_class: type, mark: Mapping[str, Any]) -> frozenset[str]:
    """Return the names of the settings of this class that have the mark `CHANGES_NO_RESULT` or `NAMES_INPUT`.

    A class that is not an attrs class has none.
    """
    if not has(config_class):
        return frozenset()
    wanted = mark[_MEANING]
    return frozenset(one.name for one in fields(config_class) if one.metadata.get(_MEANING) == wanted)
