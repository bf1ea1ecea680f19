"""Whether two recognition rates agree within a margin, by the interval of their difference."""

from __future__ import annotations

from typing import Final, Literal

MARGIN: Final = 0.02
"""Rates that differ by less than this are equivalent: 2 percentage points."""
Verdict = Literal["agrees", "differs", "cannot be told"]


def verdict_on(interval: tuple[float, float] | None, margin: float = MARGIN) -> Verdict:
    """Return what the interval of a difference of two rates says of it; None: there is no interval.

    `agrees`: every value of the interval is smaller than the margin. `differs`: it does not contain zero. A difference
    that is both agrees: it is shown, and too small to matter.
    """
    if interval is not None and -margin < interval[0] and interval[1] < margin:
        return "agrees"
    return "cannot be told" if interval is None or interval[0] <= 0.0 <= interval[1] else "differs"
