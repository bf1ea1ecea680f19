"""Times as programs write them in text: ISO 8601, with or without a zone, other dates, and times of the day."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.written_numbers import is_missing

Numbers = NDArray[np.float64]

_TIME: Final = re.compile(
    r"(?:(?P<year>[0-9]{4})[-/]?(?P<month>[0-9]{2}|(?<=[-/])[0-9])[-/]?(?P<day>[0-9]{2}|(?<=[-/])[0-9])[T ]"
    r"|(?P<a>[0-9]{1,2})(?P<mark>[./-])(?P<b>[0-9]{1,2})(?P=mark)(?P<c>[0-9]{4}|[0-9]{2}),? |[0-9]+ days?,? )?"
    r"(?P<hour>[0-9]{1,2}):?(?P<minute>[0-9]{2}):?(?P<second>[0-9]{2}(?:[.,][0-9]{1,9}|:[0-9]{3,9})?)"
    r"(?: ?(?P<half>[AP])\.?M\.?)? ?(?P<utc>Z|UTC|GMT|)(?P<zone>[-+][0-9]{2}:?[0-9]{2}|)",
    re.IGNORECASE,
)
_MONTHS: Final = [
    "jan|ene|gen", "feb|f[e\u00e9]v", "m[a\u00e4]r|mrz|mrt", "a[pvb]r", "ma[yijg]|mei", "jun|juin|giu", "jul|juil|lug",
    "aug|ao[u\u00fb]|ago", "se[pt]", "o[ck]t|ott|out", "nov", "d[e\u00e9][cz]|dic",
]  # fmt: skip
"""How the names of the months begin in English, German, French, Spanish, Italian, Dutch and Portuguese."""
_MONTH: Final = re.compile(rf"(?<=\d)\.?[- ](?:({')|('.join(_MONTHS)}))[^\W\d]*\.?[- ]", re.IGNORECASE)
_MINUTES: Final = re.compile(r"[0-5]?[0-9]:[0-5][0-9][.,][0-9]{1,9}")
"""Minutes and seconds; without a fraction they can be hours and minutes."""
_DAY_S: Final = 86_400.0
_HOUR_S: Final = 3_600.0


def seconds_since_first(cells: Sequence[str]) -> Numbers | None:
    """Return the times of a column in seconds since its first one, None if a cell is not a time.

    Times with a zone are compared as instants; those without one are all taken to be of the same zone. A time of the
    day that is earlier by more than half a day than the one before is of the next day, and so with minutes and hours.
    Of the day and the month in `3/4/2026`, the first is what makes the column shorter. A missing one is NaN.
    """
    given = [k for k, cell in enumerate(cells) if not is_missing(cell)]
    if 0 < len(given) < len(cells):
        known, times = seconds_since_first([cells[k] for k in given]), np.full(len(cells), np.nan)
        times[given] = np.nan if known is None else known
        return None if known is None else times
    if cells and all(map(_MINUTES.fullmatch, cells)):
        parts = [cell.replace(",", ".").split(":") for cell in cells]
        return _unwound(
            np.array([60.0 * int(minutes) + float(seconds) for minutes, seconds in parts]), _HOUR_S
        )
    readings = [
        seconds for seconds in (_seconds(cells, month_first=k) for k in (True, False)) if seconds is not None
    ]
    return min(readings, key=np.ptp) if readings else None


def _seconds(cells: Sequence[str], *, month_first: bool) -> Numbers | None:
    """Return the times in seconds since the first one, None if a cell is not a time."""
    times, dated = [], False
    for cell in cells:
        match = _TIME.fullmatch(_MONTH.sub(lambda name: f".{name.lastindex}.", cell))
        if match is None or not (match["year"] or match["c"] or ":" in cell):
            return None
        dated = dated or bool(match["year"] or match["c"])
        try:
            times.append(_time(match, month_first=month_first))
        except ValueError:
            return None
    if not times or len({time.tzinfo is None for time in times}) > 1:
        return None
    microseconds = [(time - times[0]) // timedelta(microseconds=1) for time in times]
    seconds = np.array(microseconds, dtype=np.float64) / 1e6
    return seconds if dated else _unwound(seconds, _DAY_S)


def _time(match: re.Match[str], *, month_first: bool) -> datetime:
    """Return the time that a text is, of any day if it names none. Raises ValueError."""
    year, month, day = match["year"] or "1970", match["month"] or "01", match["day"] or "01"
    if match["c"]:
        year, month, day = f"20{match['c']}"[-4:], match["b"], match["a"]
        if month_first and match["mark"] != ".":
            month, day = day, month
    hour = int(match["hour"])
    if match["half"]:
        if not 1 <= hour <= 12:
            raise ValueError(hour)
        hour = hour % 12 + 12 * (match["half"] in "pP")
    seconds = match["second"].replace(":", ".")
    zone = match["zone"] or ("Z" if match["utc"] else "")
    text = f"{year}-{int(month):02}-{int(day):02}T{hour:02}:{match['minute']}:{seconds}{zone}"
    return datetime.fromisoformat(text)


def _unwound(seconds: Numbers, period_s: float) -> Numbers:
    """Return times since the first one of a clock that begins anew after each period."""
    again = np.cumsum(np.diff(seconds, prepend=seconds[:1]) < -0.5 * period_s)
    unwound: Numbers = seconds - seconds[0] + period_s * again
    return unwound
