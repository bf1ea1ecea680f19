"""Where the fingers of a recording close, and whether a force was measured there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from graspsense.core.values.errors import counted
from graspsense.sources.columns.channel_facts import usual_range
from graspsense.sources.columns.grasp_columns import GraspColumns
from graspsense.sources.formats.table import Numbers

CLOSED: Final = 0.4
OPEN: Final = 0.6
"""Shares of its range below which the gap is closed, and above which it is open."""
FEWEST: Final = 3
"""Fewest samples of a closing."""
KNOWN: Final = 0.1
"""Share of the samples of a closing up to which its force is not known."""


def closings(gap: Numbers) -> list[tuple[int, int]]:
    """Return the first sample of each time at which the fingers are closed, and the one after its last."""
    known = np.flatnonzero(np.isfinite(gap))
    if not len(known):
        return []
    low, high = usual_range(gap[known])
    spans: list[tuple[int, int]] = []
    begin: int | None = None
    for k in known.tolist() if high > low else ():
        if begin is None and gap[k] < low + CLOSED * (high - low):
            begin = k
        elif begin is not None and gap[k] > low + OPEN * (high - low):
            spans.append((begin, k))
            begin = None
    if begin is not None:
        spans.append((begin, len(gap)))
    return [(begin, end) for begin, end in spans if end - begin >= FEWEST]


def without_number(t_s: Numbers, gap: Numbers, force: Numbers) -> Iterator[str]:
    """Yield a sentence if the force has no number in a closing."""
    known = np.isfinite(force)
    missed = [begin for begin, end in closings(gap) if known[begin:end].mean() < KNOWN]
    yield from _told(t_s, missed, "while the force has no number", "these squeezes are missing")


def without_rise(columns: GraspColumns, squeezes: Sequence[tuple[int, int]]) -> Iterator[str]:
    """Yield a sentence if the force does not rise in a closing, or hardly; `squeezes` are those in which it does."""
    missed = [
        begin
        for begin, end in closings(columns.gap_m)
        if not any(rise < end and fall > begin for rise, fall in squeezes)
    ]
    asked = "was nothing between them, did the force fail, or was it less than a tenth of the usual one?"
    yield from _told(columns.t_s, missed, "without a squeeze", asked)


def _told(t_s: Numbers, begins: Sequence[int], how: str, asked: str) -> Iterator[str]:
    if begins:
        times = counted(len(begins), "time")
        yield f"the fingers close {times} {how} (the first at {t_s[begins[0]]:.4g} s): {asked}"
