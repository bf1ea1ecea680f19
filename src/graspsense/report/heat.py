"""A colour scale of eight levels, with its legend: that of heat maps and spectrograms. `page.css` has its colours."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
from attrs import frozen

from graspsense.report.svg import QUIET, Picture, number

LEVELS: Final = 8
_FALLBACK: Final = ("#e6effa", "#cfe0f3", "#b3cfec", "#96bee1", "#2d69a0", "#215a8f", "#154b7e", "#083c6e")
COLOURS: Final = tuple(f"var(--q{k + 1},{colour})" for k, colour in enumerate(_FALLBACK))
"""From the least level to the greatest; the fallback is for pictures without a page."""

GREYS: Final = tuple(f"hsl(0,0%,{100 * k / (LEVELS - 1):.0f}%)" for k in range(LEVELS))
"""From black to white, for arrays that are drawn as pictures."""


@frozen
class HeatScale:
    """Equal steps of colour from `low` to `high`, in `unit`."""

    low: float
    high: float
    unit: str

    @classmethod
    def over(cls, values: Iterable[float], unit: str) -> HeatScale:
        """Return the scale that reaches from the least of these values to the greatest; NaN is left out."""
        known = [value for value in values if math.isfinite(value)] or [0.0]
        low, high = min(known), max(known)
        return cls(low, high if high > low else low + 1.0, unit)

    def level(self, value: float) -> int:
        """Return the number of the colour of a value, from 0; -1 for a value that is missing."""
        if not math.isfinite(value):
            return -1
        share = (value - self.low) / (self.high - self.low)
        return min(max(int(share * LEVELS), 0), LEVELS - 1)

    def legend(
        self,
        picture: Picture,
        left: float,
        y: float,
        width: float,
        colours: Sequence[str] = COLOURS,
    ) -> None:
        """Draw the colours side by side, with the values at which the scale begins, halves and ends."""
        step = width / len(colours)
        for k, colour in enumerate(colours):
            picture.box(left + k * step, y, step, 10, colour)
        for share, anchor in ((0.0, "start"), (0.5, "middle"), (1.0, "end")):
            value = self.low + share * (self.high - self.low)
            words = number(float(f"{value:.3g}"))
            picture.text(
                left + share * width,
                y + 23,
                f"{words} {self.unit}" if anchor == "end" else words,
                anchor=anchor,
                ink=QUIET,
            )


def heat_rows(
    picture: Picture, levels: np.ndarray, left: float, top: float, width: float, height: float
) -> None:
    """Draw an image (rows, columns) of levels into a rectangle; cells of one level in a row are drawn as one."""
    rows, columns = levels.shape
    wide, high = width / columns, height / rows
    paths: dict[int, list[str]] = {}
    for i, row in enumerate(levels):
        starts = [0, *(np.flatnonzero(np.diff(row)) + 1).tolist()]
        for start, end in zip(starts, [*starts[1:], columns], strict=True):
            if row[start] >= 0:
                paths.setdefault(int(row[start]), []).append(
                    f"M{left + start * wide:.1f} {top + i * high:.1f}h{(end - start) * wide:.1f}v{high:.1f}"
                    f"h{-(end - start) * wide:.1f}z"
                )
    for level, parts in sorted(paths.items()):
        picture.parts.append(
            f'<path d="{"".join(parts)}" fill="{COLOURS[level]}" shape-rendering="crispEdges"/>'
        )
