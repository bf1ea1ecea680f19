"""Rates with their intervals, as pictures and as a table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from attrs import frozen

from graspsense.evaluation.intervals import RecognitionRate, percent, span
from graspsense.report.html import facts, figure, table
from graspsense.report.svg import (
    DASHES,
    INKS,
    LINE,
    QUIET,
    WIDTH,
    AxisScale,
    Picture,
    lines_within,
    number,
    reaching,
)


@frozen(kw_only=True)
class RateRow:
    """A rate to be shown: its name, its value and interval as shares, and what it is in words."""

    name: str
    rate: float
    interval: tuple[float, float] | None
    what: str = ""
    strong: bool = False
    """Whether it is the rate that the others are compared with."""
    joined: bool = True
    """Whether the line of its series goes through it, where it is drawn against a number; else its mark is small."""

    @property
    def words(self) -> str:
        """The rate in per cent with its interval."""
        return f"{percent(self.rate)} ({span(self.interval)})"


def rate_row(name: str, measured: RecognitionRate, what: str = "", *, strong: bool = False) -> RateRow:
    """Return the row of a rate of trials."""
    return RateRow(name=name, rate=measured.rate, interval=measured.interval, what=what, strong=strong)


ROW: Final = 34
LEGEND: Final = 15.0
"""Height of a name in a legend."""
STEP: Final = 5.0
"""Ends of a rate axis are multiples of this, in per cent."""
NEARLY_WHOLE: Final = 80.0
"""An axis that would span more than this many percentage points shows 0 to 100 %."""


def rate_scale(rows: Sequence[RateRow], start: float, end: float) -> AxisScale:
    """Return an axis in per cent that is cut to the range of these rates and their intervals."""
    shares = [share for row in rows for share in (row.rate, *(row.interval or ()))] or [0.0, 1.0]
    low = max(STEP * math.floor((100 * min(shares) - 1) / STEP), 0.0)
    high = min(STEP * math.ceil((100 * max(shares) + 1) / STEP), 100.0)
    if high - low > NEARLY_WHOLE:
        low, high = 0.0, 100.0
    return AxisScale(low, high, start, end)


def rate_axis_title(scale: AxisScale) -> str:
    """Return the title of a rate axis, which says so where the axis is cut."""
    cut = scale.low > 0.0 or scale.high < 100.0
    return "recognised, in %" + (f" (axis from {scale.low:g} to {scale.high:g})" if cut else "")


def draw_breaks(picture: Picture, scale: AxisScale, x: float, y: float, *, upright: bool) -> None:
    """Mark the ends at which a rate axis is cut by two slashes across it; `x` or `y` is where the axis lies."""
    for end, place, cut in ((0, scale.start, scale.low > 0.0), (1, scale.end, scale.high < 100.0)):
        if cut:
            shift = 5.0 * (1 if end else -1)
            # Within the upper end of an upright axis, above which its title stands.
            across, down = (x, place + 5.0) if upright else (place + shift, y)
            for offset in (-2.5, 2.5):
                left, top = (across, down + offset) if upright else (across + offset, down)
                picture.line([(left - 4, top + 4), (left + 4, top - 4)], QUIET, width=1.4)


def rates_picture(rows: Sequence[RateRow], caption: str) -> str:
    """Return a figure with a row for each rate: its name, a mark, and a bar for its interval."""
    named = [lines_within(f"{row.name}: {100 * row.rate:.1f} %", WIDTH - 16) for row in rows]
    tops = [ROW * k + LINE * sum(len(lines) - 1 for lines in named[:k]) for k in range(len(rows) + 1)]
    bottom = 6.0 + tops[-1]
    picture = Picture(bottom + 34)
    scale = rate_scale(rows, 16.0, picture.width - 16)
    picture.x_axis(scale, 4, bottom, rate_axis_title(scale))
    draw_breaks(picture, scale, 0.0, bottom, upright=False)
    for row, lines, top in zip(rows, named, tops, strict=False):
        for k, line in enumerate(lines):
            picture.text(8, 17.0 + top + LINE * k, line, bold=row.strong)
    with picture.plot(scale, None, 4, bottom):
        for k, row in enumerate(rows):
            y = 27.0 + tops[k + 1] - ROW
            ink = INKS[0] if row.strong else INKS[7]
            if row.interval is not None:
                low, high = (scale(100 * end) for end in row.interval)
                picture.line([(low, y), (high, y)], ink, width=3)
            words = f"{row.name}: {row.words}"
            picture.mark(scale(100 * row.rate), y, ink, 0 if row.strong else 3, 4.5, words)
    words = "; ".join(f"{row.name} {row.words}" for row in rows)
    return figure(picture.svg(f"Recognition rates with 95 % intervals: {words}"), caption)


def rates_over(
    series: Mapping[str, Sequence[tuple[float, RateRow]]], axis: str, caption: str, guess: float | None = None
) -> str:
    """Return a figure of rates against a number, one line per series through those of its rates that are `joined`.

    `guess` is the rate of guessing.
    """
    legends = [lines_within(name, WIDTH - 80) for name in series]
    drawn = {name: sorted(points, key=lambda point: point[0]) for name, points in series.items()}
    below = 262.0 + LINE * (len(lines_within(axis, WIDTH)) - 1)
    picture = Picture(below + LEGEND * len(series) + LINE * sum(len(lines) - 1 for lines in legends))
    xs = [x for points in series.values() for x, _ in points]
    x_scale = reaching(xs, 44, picture.width - 14)
    y_scale = rate_scale([row for points in series.values() for _, row in points], 215, 24)
    picture.y_axis(y_scale, 36, picture.width - 8, rate_axis_title(y_scale))
    draw_breaks(picture, y_scale, 36, 0.0, upright=True)
    picture.x_axis(x_scale, 24, 215, axis)
    with picture.plot(x_scale, y_scale, 24, 215):
        if guess is not None and y_scale.low <= 100 * guess <= y_scale.high:
            ends = (x_scale.start, x_scale.end)
            picture.line([(x, y_scale(100 * guess)) for x in ends], QUIET, dash="3 3")
            caption += f" The dashed line is always guessing the most frequent label, {100 * guess:.0f} %."
        elif guess is not None:
            where = "below" if 100 * guess < y_scale.low else "above"
            caption += f" Always guessing the most frequent label, {100 * guess:.0f} %, is {where} the axis."
        for k, points in enumerate(drawn.values()):
            ink, dash = INKS[k % len(INKS)], DASHES[k % len(DASHES)]
            # Each series is shifted, so that intervals at the same x do not hide each other.
            shift = 5.0 * (k - (len(series) - 1) / 2)
            places = [(x_scale(x) + shift, y_scale(100 * row.rate), row) for x, row in points]
            picture.line([(x, y) for x, y, row in places if row.joined], ink, width=2, dash=dash)
            for x, y, row in places:
                if row.interval is not None:
                    picture.line([(x, y_scale(100 * end)) for end in row.interval], ink, width=2)
                picture.mark(x, y, ink, k, 4.0 if row.joined else 1.8, f"{row.name}: {row.words}")
    told, y = [], below
    for k, (name, points) in enumerate(drawn.items()):
        ink, dash = INKS[k % len(INKS)], DASHES[k % len(DASHES)]
        picture.line([(40, y - 4), (66, y - 4)], ink, width=2, dash=dash)
        picture.mark(53, y - 4, ink, k)
        for line in legends[k]:
            picture.text(72, y, line)
            y += LINE
        y += LEGEND - LINE
        told.append(f"{name}: " + ", ".join(f"{number(x)}: {row.words}" for x, row in points))
    return figure(
        picture.svg(f"Recognition rate against {axis}, with 95 % intervals. {'; '.join(told)}"), caption
    )


def rates_table(caption: str, rows: Sequence[RateRow], heading: str = "recognised") -> str:
    """Return the rates as a table; `heading` says what they are the rates of."""
    cells = [(row.name, percent(row.rate), span(row.interval)) for row in rows]
    return table(caption, ("case", heading, "95 % interval, %"), cells, 1)


def rates_list(rows: Sequence[RateRow]) -> str:
    """Return the rates as a list that says in words what each is."""
    return facts([(row.name, f"{row.words}: {row.what}" if row.what else row.words) for row in rows])
