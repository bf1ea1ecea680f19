"""Times as programs write them in text: ISO 8601 with or without a zone, and times of the day."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_TIME: Final = re.compile(
    r"(?P<day>[0-9]{4}-?[0-9]{2}-?[0-9]{2}[T ])?(?P<time>[0-9]{2}:?[0-9]{2}:?[0-9]{2}(?:[.,][0-9]{1,9})?)"
    r" ?(?P<zone>Z|[-+][0-9]{2}:?[0-9]{2}|)"
)
_ANY_DAY: Final = "1970-01-01T"
_DAY_S: Final = 86_400.0


def seconds_since_first(cells: Sequence[str]) -> NDArray[np.float64] | None:
    """Return the times of a column in seconds since its first one, None if a cell is not a time.

    Times with a zone are compared as instants; those without one are all taken to be of the same zone. A time of the
    day that is earlier by more than half a day than the one before is of the next day.
    """
    import numpy as np

    times, dated = [], False
    for cell in cells:
        match = _TIME.fullmatch(cell)
        if match is None or not (match["day"] or ":" in match["time"]):
            return None
        dated = dated or bool(match["day"])
        try:
            times.append(datetime.fromisoformat((match["day"] or _ANY_DAY) + match["time"] + match["zone"]))
        except ValueError:
            return None
    if not times or len({time.tzinfo is None for time in times}) > 1:
        return None
    microseconds = [(time - times[0]) // timedelta(microseconds=1) for time in times]
    seconds = np.array(microseconds, dtype=np.float64) / 1e6
    if not dated:
        midnights = np.cumsum(np.diff(seconds, prepend=0.0) < -0.5 * _DAY_S)
        seconds += _DAY_S * midnights
    return seconds
