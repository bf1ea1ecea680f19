"""SVG pictures for a page: scales, axes and marks. Each picture has a description for those who cannot see it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from html import escape
from textwrap import wrap
from typing import Final

from attrs import define, field, frozen

WIDTH: Final = 360.0
"""Width of a picture. On a phone a unit is about one pixel, so that text stays readable."""
SIZE: Final = 11.0
"""Font size of text."""
_INKS: Final = ("#0b5fa5", "#b3400a", "#1b7a3d", "#7b2d8b", "#00707a", "#a8174f", "#7a5c00", "#3d3d3d")
INKS: Final = tuple(f"var(--ink{k},{colour})" for k, colour in enumerate(_INKS))
"""Colours of lines and marks: those of `page.css`, for light and dark; the fallback is for pictures without a page."""
DASHES: Final = ("", "7 3", "2 2.5", "9 3 2 3", "4 2", "1 3", "12 3", "6 2 2 2")
"""Dash patterns of lines, which differ in these as well as in colour."""
TEXT: Final = "var(--text,#1a1a1a)"
QUIET: Final = "var(--quiet,#5c5c5c)"
GRID: Final = "var(--grid,#dcdcdc)"
GROUND: Final = "var(--ground,#fff)"


@frozen
class AxisScale:
    """A linear map from values to positions in a picture."""

    low: float
    high: float
    start: float
    end: float

    def __call__(self, value: float) -> float:
        """Return the position of a value, limited to just outside the axis."""
        share = (value - self.low) / ((self.high - self.low) or 1.0)
        return self.start + (self.end - self.start) * min(max(share, -0.02), 1.02)

    def ticks(self, about: int = 5) -> list[float]:
        """Return about this many round values within the range."""
        span = (self.high - self.low) or 1.0
        power = 10.0 ** math.floor(math.log10(span / about))
        step = next(factor * power for factor in (1, 2, 5, 10) if span / (factor * power) <= about)
        lowest = math.ceil(self.low / step - 1e-9)
        last = math.floor(self.high / step + 1e-9)
        return [k * step for k in range(lowest, last + 1)]


def reaching(values: Sequence[float], start: float, end: float, *, zero: bool = False) -> AxisScale:
    """Return a scale that shows all of these values, and also zero if `zero` is set."""
    known = [value for value in values if math.isfinite(value)] or [0.0, 1.0]
    low, high = min(known), max(known)
    if zero:
        low, high = min(low, 0.0), max(high, 0.0)
    room = 0.04 * (high - low) or 0.5 * abs(high) or 1.0
    return AxisScale(low if zero and low == 0.0 else low - room, high + room, start, end)


def number(value: float) -> str:
    """Return a number as it is written at an axis."""
    text = f"{value:.4g}"
    if "e+0" in text and abs(value) < 1e6:
        text = f"{float(text):.0f}"
    return text.replace("-", "−") if text != "-0" else "0"


CHARACTER: Final = 0.56
"""Mean width of a character over the font size, rather too wide than too narrow."""
LINE: Final = 13.0
"""Distance of two lines of text."""


def lines_within(words: str, room: float, size: float = SIZE) -> list[str]:
    """Return the lines of a text that is at most `room` wide; a long word is broken."""
    return wrap(words, max(int(room / (CHARACTER * size)), 8), break_on_hyphens=False) or [""]


@define
class Picture:
    """An SVG picture under construction."""

    height: float
    width: float = WIDTH
    parts: list[str] = field(factory=list, init=False)

    @contextmanager
    def plot(self, x: AxisScale, y: AxisScale | None, top: float, bottom: float) -> Iterator[None]:
        """Put what is drawn within the context into a plot with these scales, which a page can zoom and read out.

        `y` is None for rows of labels. `top` and `bottom` are the edges of the plot.
        """
        vertical = "" if y is None else f' data-y="{_range(y)}"'
        self.parts.append(
            f'<g class="plot" data-x="{_range(x)}"{vertical} data-top="{top:g}" data-bottom="{bottom:g}">'
        )
        yield
        self.parts.append("</g>")

    def line(
        self,
        points: Sequence[tuple[float, float]],
        ink: str,
        *,
        width: float = 1.5,
        dash: str = "",
        name: str = "",
        more: str = "",
    ) -> None:
        """Draw a line through these points; the values of a line with a `name` are read out on a page.

        `more` are further attributes.
        """
        path = " ".join(f"{x:.2f},{y:.2f}" for x, y in points)
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        named = f' data-name="{escape(name)}"' if name else ""
        self.parts.append(
            f'<polyline points="{path}" fill="none" stroke="{ink}" stroke-width="{width:g}"{dashes}{named}{more}/>'
        )

    def box(self, x: float, y: float, width: float, height: float, fill: str, edge: str = "none") -> None:
        """Draw a rectangle, by its corners: a page moves them when a plot is zoomed."""
        corners = ((x, y), (x + width, y), (x + width, y + height), (x, y + height))
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in corners)
        self.parts.append(f'<polygon points="{path}" fill="{fill}" stroke="{edge}"/>')

    def mark(self, x: float, y: float, ink: str, shape: int = 0, size: float = 4.0, words: str = "") -> None:
        """Draw a mark, one of four shapes; `words` are shown under the pointer."""
        corners = {
            1: ((-1, -1), (1, -1), (1, 1), (-1, 1)),
            2: ((0, -1.3), (1.2, 1), (-1.2, 1)),
            3: ((0, -1.4), (1.4, 0), (0, 1.4), (-1.4, 0)),
        }.get(shape % 4)
        if corners is None:
            drawn = f'<circle r="{size:g}" fill="{ink}"/>'
        else:
            path = " ".join(f"{size * dx:.1f},{size * dy:.1f}" for dx, dy in corners)
            drawn = f'<polygon points="{path}" fill="{ink}"/>'
        title = f"<title>{escape(words)}</title>" if words else ""
        self.parts.append(f'<g transform="translate({x:.2f} {y:.2f})">{drawn}{title}</g>')

    def dots(self, points: Sequence[tuple[float, float]], ink: str, name: str = "") -> None:
        """Draw many small dots as one path; `name` and the value of a dot are read out on a page."""
        path = "".join(f"M{x:.2f} {y:.2f}h0" for x, y in points)
        named = f' data-name="{escape(name)}"' if name else ""
        self.parts.append(
            f'<path d="{path}" stroke="{ink}" stroke-width="3" stroke-linecap="round" stroke-opacity="0.6"{named}/>'
        )

    def title(self, words: str) -> None:
        """Draw the title in one line; the caption has what there is no room for."""
        line, *further = lines_within(words, self.width - 30, 13)
        self.text(2, 14, f"{line}…" if further else line, bold=True, size=13)

    def text(
        self,
        x: float,
        y: float,
        words: str,
        *,
        anchor: str = "start",
        ink: str = TEXT,
        bold: bool = False,
        size: float = SIZE,
    ) -> None:
        """Write words; `anchor` is `start`, `middle` or `end`."""
        weight = ' font-weight="600"' if bold else ""
        self.parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{ink}" font-size="{size:g}"{weight} '
            f'paint-order="stroke" stroke="{GROUND}" stroke-width="2.5" stroke-opacity="0.8">'
            f"{escape(words)}</text>"
        )

    def x_axis(self, scale: AxisScale, top: float, bottom: float, title: str) -> None:
        """Draw the ticks of a horizontal axis, with lines up to `top`, and its title below, which may need lines."""
        self.parts.append(f'<g class="axis x" data-scale="{_range(scale)}" data-span="{top:g} {bottom:g}">')
        for value in scale.ticks():
            x = scale(value)
            self.line([(x, top), (x, bottom)], GRID, width=1)
            self.text(x, bottom + 13, number(value), anchor="middle", ink=QUIET)
        self.parts.append("</g>")
        lines = lines_within(title, self.width) if title else []
        middle = (scale.start + scale.end if len(lines) == 1 else self.width) / 2
        for k, words in enumerate(lines):
            self.text(middle, bottom + 28 + LINE * k, words, anchor="middle", ink=QUIET)

    def y_axis(self, scale: AxisScale, left: float, right: float, title: str) -> None:
        """Draw the ticks of a vertical axis, and its title above."""
        self.parts.append(f'<g class="axis y" data-scale="{_range(scale)}" data-span="{left:g} {right:g}">')
        for value in scale.ticks(4):
            y = scale(value)
            self.line([(left, y), (right, y)], GRID, width=1)
            self.text(left - 4, y + 4, number(value), anchor="end", ink=QUIET)
        self.parts.append("</g>")
        self.text(2, min(scale.start, scale.end) - 8, title, ink=QUIET)

    @contextmanager
    def axes(self, x: AxisScale, y: AxisScale, x_title: str, y_title: str) -> Iterator[None]:
        """Draw both axes where their scales lie, and put what is drawn within the context into their plot."""
        self.x_axis(x, y.end, y.start, x_title)
        self.y_axis(y, x.start, x.end, y_title)
        with self.plot(x, y, y.end, y.start):
            yield

    def svg(self, words: str, unit: str = "") -> str:
        """Return the picture; `words` say what it shows, `unit` is that of the horizontal axis for values read out."""
        read_out = f' data-unit="{escape(unit)}"' if unit else ""
        return (
            f'<svg viewBox="0 0 {self.width:g} {self.height:g}" role="img" aria-label="{escape(words)}" '
            f'xmlns="http://www.w3.org/2000/svg"{read_out}>{"".join(self.parts)}</svg>'
        )


def _range(scale: AxisScale) -> str:
    return f"{scale.low:.6g} {scale.high:.6g} {scale.start:g} {scale.end:g}"
