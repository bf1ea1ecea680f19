"""Three verdicts: a result agrees with the paper, differs from it, or this cannot be told from so few trials."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final, Literal

Verdict = Literal["agrees", "differs", "cannot be told"]
VERDICTS: Final[tuple[Verdict, ...]] = ("agrees", "differs", "cannot be told")
AGREES, DIFFERS, UNTOLD = VERDICTS


def within(interval: tuple[float, float] | None, low: float = -math.inf, high: float = math.inf) -> Verdict:
    """Return whether the 95 % interval of a figure lies within these limits, or wholly beyond one of them."""
    if interval is None:
        return UNTOLD
    if low <= interval[0] and interval[1] <= high:
        return AGREES
    return DIFFERS if interval[1] < low or interval[0] > high else UNTOLD


def every(verdicts: Collection[Verdict]) -> Verdict:
    """Return the verdict on a claim that needs all of these to agree."""
    if DIFFERS in verdicts:
        return DIFFERS
    return UNTOLD if UNTOLD in verdicts or not verdicts else AGREES


def counted(verdicts: Collection[Verdict]) -> str:
    """Return how many agree, differ, and cannot be told."""
    agree, differ, untold = (sum(verdict == kind for verdict in verdicts) for kind in VERDICTS)
    text = f"{agree} agree{'s' if agree == 1 else ''} and {differ} differ{'s' if differ == 1 else ''}"
    return text + (f", and {untold} cannot be told" if untold else "")
