"""What a user writes behind `lerobot:`: a folder, and options that mend what the data set does not tell.

FOLDER?gap_m_per_unit=0.0008&fps=30&repeated=drop
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qsl

from attrs import fields_dict, frozen

from graspsense.plugin_api import ConfigError
from graspsense.simulator_api import suggestion

_WORDS: Final = {"repeated": ("keep", "drop"), "gaps": ("keep", "cut"), "split": ("force", "none")}
_NAMES: Final = ("gap", "force", "annotate")


@frozen(kw_only=True)
class PlaceOptions:
    """How a data set is read; a name or a number that is not given follows from the data set."""

    gap: str = ""
    """The name of the number that is the opening."""
    force: str = ""
    """The name of the number, or of the two with a comma between, that are the force."""
    gap_m_per_unit: float | None = None
    """Metres of the opening for one unit of its number; negative if the number grows while the gripper closes."""
    gap_zero: float = 0.0
    """The number at which the gripper is closed."""
    force_n_per_unit: float | None = None
    """Newtons for one unit of the force."""
    fps: float | None = None
    """The true frames per second: times then are frame numbers divided by it."""
    repeated: str = "keep"
    """`drop` leaves out frames that are equal to the one before."""
    gaps: str = "keep"
    """`cut` divides an episode where frames are missing."""
    annotate: str = ""
    """Writing: the data set of which the trials were imported, and of which a copy is annotated."""
    split: str = "force"
    """`none` makes one trial of an episode; else each squeeze of it becomes one."""


def folder_and_options(place: str) -> tuple[Path, PlaceOptions]:
    """Return the folder and the options that a place names. Raises ConfigError."""
    whole = Path(place).expanduser()
    folder, mark, query = place.partition("?")
    if not mark or whole.is_dir():
        return whole, PlaceOptions()
    given: dict[str, Any] = {}
    known = tuple(fields_dict(PlaceOptions))
    for key, text in parse_qsl(query, keep_blank_values=True):
        if key not in known:
            raise ConfigError(
                f"{key!r} is not an option of lerobot:FOLDER. Known: {', '.join(known)}.{suggestion(key, known)}"
            )
        given[key] = _value(key, text)
    return Path(folder).expanduser(), PlaceOptions(**given)


def _value(key: str, text: str) -> str | float:
    if key in _NAMES:
        return text
    if key in _WORDS:
        if text not in _WORDS[key]:
            raise ConfigError(f"{key}={text!r}: write {' or '.join(_WORDS[key])}")
        return text
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or (key != "gap_zero" and number == 0.0) or (key == "fps" and number < 0.0):
        raise ConfigError(f"{key}={text!r} is not a number that can be used there, such as 0.001")
    return number
