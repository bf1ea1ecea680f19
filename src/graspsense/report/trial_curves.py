"""The trials of a store as small curves: chosen ones are drawn over each other in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from graspsense.core.values.errors import counted
from graspsense.report.grasp_curve import GraspCurve, peak_in_words
from graspsense.report.html import Section, figure, paragraph
from graspsense.report.svg import DASHES, INKS, AxisScale, Picture, reaching

FIRST_CHOSEN: Final = 6
"""Trials that are drawn over each other before anything is chosen: the newest of so many labels."""
SMALL: Final = (120.0, 54.0)
"""Width and height of a small curve."""


def trial_curves(curves: Sequence[GraspCurve]) -> Section:
    """Return the section of these trials, the newest first; there is at least one."""
    labels = list(dict.fromkeys(curve.label for curve in curves))
    newest = [next(curve.trial for curve in curves if curve.label == label) for label in labels]
    chosen = newest[:FIRST_CHOSEN] if len(newest) > 1 else [curve.trial for curve in curves[:FIRST_CHOSEN]]
    text = paragraph(
        f"Force over time of {counted(len(curves), 'trial')}, from shortly before the contact until the fingers "
        "open. Choose trials to draw them over each other; a label has its dashes, and a trial its colour."
    )
    small = "".join(
        _small(curve, k, labels.index(curve.label), curve.trial in chosen) for k, curve in enumerate(curves)
    )
    body = f'{text}<div class="choose">{_over_each_other(curves, labels, chosen)}<div class="small">{small}</div></div>'
    return Section(id="trials", title="Trials to compare", body=body)


def _over_each_other(curves: Sequence[GraspCurve], labels: Sequence[str], chosen: Sequence[int]) -> str:
    """Return the large picture with the force and the gap of every trial, of which the chosen ones are shown."""
    picture = Picture(334)
    x = _times(curves, 36, picture.width - 10)
    force = reaching(_values(curves, "force_n"), 150, 30, zero=True)
    gap = reaching(_values(curves, "gap_mm"), 296, 192)
    picture.x_axis(x, 30, 296, f"{curves[0].time_words} since the squeeze began")
    picture.y_axis(force, 36, picture.width - 10, f"{curves[0].force}, N")
    picture.y_axis(gap, 36, picture.width - 10, "gap, mm")
    for column, unit, scale, top, bottom in (
        ("force_n", "N", force, 30.0, 150.0),
        ("gap_mm", "mm", gap, 192.0, 296.0),
    ):
        with picture.plot(x, scale, top, bottom):
            for k, curve in enumerate(curves):
                picture.line(
                    _points(curve, column, x, scale),
                    INKS[k % len(INKS)],
                    dash=DASHES[labels.index(curve.label) % len(DASHES)],
                    name=f"trial {curve.trial}, {curve.label}, {unit}",
                    more=f' data-trial="{curve.trial}"'
                    + ("" if curve.trial in chosen else ' class="left-out"'),
                )
    words = f"Force and gap over time of the chosen trials, of {len(curves)}"
    return figure(
        picture.svg(words, curves[0].time_unit), "The chosen trials over each other: force above, gap below."
    )


def _small(curve: GraspCurve, k: int, label: int, chosen: bool) -> str:
    """Return a small picture of the force of one trial, with the box that chooses it.

    Its colour is that of the k-th trial, its dashes are those of its label.
    """
    width, height = SMALL
    picture = Picture(height, width)
    x, y = _times([curve], 2, width - 2), reaching(_values([curve], "force_n"), height - 3, 3, zero=True)
    picture.line(_points(curve, "force_n", x, y), INKS[k % len(INKS)], dash=DASHES[label % len(DASHES)])
    name = f"{curve.trial} {curve.label}"
    checked, peak = " checked" if chosen else "", peak_in_words([curve])
    return (
        f'<label><input type="checkbox" value="{curve.trial}"{checked}> {escape(name)}'
        f"{picture.svg(f'trial {name}: {peak}')}<span>{peak}</span></label>"
    )


def _times(curves: Sequence[GraspCurve], start: float, end: float) -> AxisScale:
    times = [t for curve in curves for t in curve.shown_times]
    return AxisScale(min(times, default=0.0), max(times, default=1.0), start, end)


def _values(curves: Sequence[GraspCurve], column: str) -> list[float]:
    return [
        value for curve in curves for _, value in curve.values(column, min(curve.shown_times, default=0.0))
    ]


def _points(curve: GraspCurve, column: str, x: AxisScale, y: AxisScale) -> list[tuple[float, float]]:
    return [(x(t), y(value)) for t, value in curve.values(column, x.low, x.high)]
