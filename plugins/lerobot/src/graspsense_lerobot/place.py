"""What a user writes behind `lerobot:`: a folder, and options that mend what the data set does not tell.

FOLDER?gap_m_per_unit=0.0008&fps=30&repeated=drop
"""

from __future__ import annotations

import os
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import Any, Final, Literal
from urllib.parse import parse_qsl

from attrs import field, frozen
from attrs.validators import and_, gt, in_, lt, not_, optional

from graspsense.plugin_api import ConfigError
from graspsense.simulator_api import ValidationFailed, structured

_FINITE: Final = and_(gt(-inf), lt(inf))
_FACTOR: Final = optional(and_(_FINITE, not_(in_((0.0,)), msg="a factor is not 0")))


@frozen(kw_only=True)
class PlaceOptions:
    """How a data set is read; a name or a number that is not given follows from the data set."""

    gap: str = ""
    """The name of the number that is the opening."""
    force: str = ""
    """The name of the number, or of the two with a comma between, that are the force."""
    gap_m_per_unit: float | None = field(default=None, validator=_FACTOR)
    """Metres of the opening for one unit of its number; negative if the number grows while the gripper closes."""
    gap_zero: float = field(default=0.0, validator=_FINITE)
    """The number at which the gripper is closed."""
    force_n_per_unit: float | None = field(default=None, validator=_FACTOR)
    """Newtons for one unit of the force."""
    fps: float | None = field(default=None, validator=optional(and_(gt(0.0), lt(inf))))
    """The true frames per second: times then are frame numbers divided by it."""
    repeated: Literal["keep", "drop"] = "keep"
    """`drop` leaves out frames that are equal to the one before."""
    gaps: Literal["keep", "cut"] = "keep"
    """`cut` divides an episode where frames are missing."""
    annotate: str = ""
    """Writing: the data set of which the trials were imported, and of which a copy is annotated."""
    split: Literal["force", "none"] = "force"
    """`none` makes one trial of an episode; else each squeeze of it becomes one."""


_NUMBERS: Final = ("gap_m_per_unit", "gap_zero", "force_n_per_unit", "fps")


def folder_and_options(place: str) -> tuple[Path, PlaceOptions]:
    """Return the folder and the options that a place names. Raises ConfigError."""
    whole = Path(os.path.expanduser(place))
    folder, mark, query = place.partition("?")
    if not mark or whole.is_dir():
        return whole, PlaceOptions()
    given: dict[str, Any] = dict(parse_qsl(query, keep_blank_values=True))
    for key in given.keys() & _NUMBERS:
        with suppress(ValueError):
            given[key] = float(given[key])
    try:
        return Path(os.path.expanduser(folder)), structured(given, PlaceOptions, "lerobot:FOLDER")
    except ValidationFailed as misfit:
        said = [f"{'.'.join(map(str, problem.path))}: {problem.words()}" for problem in misfit.problems]
        raise ConfigError("\n".join(said)) from None
