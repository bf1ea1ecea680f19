"""The table `[identified]` of a scene file, in which `graspsense identify` notes what the scene was made from.

The simulator checks it only: the numbers of a scene are its other keys. The trials of identified scenes need its label
and its settings of the gripper.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from graspsense.simulator_api import suggestion


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_interval(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


_TABLES: Final[Mapping[str, tuple[Callable[[Any], bool], str]]] = {
    "gripper": (_is_number, "a number"),
    "sensor": (_is_number, "a number"),
    "intervals": (_is_interval, "two numbers"),
    "recordings": (_is_text, "the hash of a recording"),
    "candidates": (_is_number, "a number"),
    "undetermined": (_is_text, "text"),
}
"""The tables in it, each with the form of its values."""


def check_identified(entry: Any, problems: list[str]) -> None:
    """Add what is wrong with the table `[identified]` to `problems`."""
    if not isinstance(entry, Mapping):
        problems.append(f"identified: {entry!r} is not a table")
        return
    known = ("label", *_TABLES)
    for key, value in entry.items():
        if key == "label":
            if not _is_text(value):
                problems.append(f"identified.label: {value!r} is not text")
        elif key not in _TABLES:
            problems.append(
                f"identified.{key}: no such key. Known: {', '.join(known)}.{suggestion(key, known)}"
            )
        elif not isinstance(value, Mapping):
            problems.append(f"identified.{key}: {value!r} is not a table")
        else:
            fits, form = _TABLES[key]
            problems += [
                f"identified.{key}.{name}: {number!r} is not {form}"
                for name, number in value.items()
                if not fits(number)
            ]
