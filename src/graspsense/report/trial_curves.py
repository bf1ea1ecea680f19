"""The trials of a store as small curves: chosen ones are drawn over each other in one picture."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from graspsense.core.values.errors import counted
from graspsense.report.grasp_curve import GraspCurve, peak_in_words
from graspsense.report.html import Section, figure, paragraph
from graspsense.report.svg import DASHES, INKS, Picture, reaching
from graspsense.report.traces import BELOW, force_and_gap, time_scale

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
    picture = Picture(BELOW)
    drawn = [
        (
            curve,
            {
                "ink": INKS[k % len(INKS)],
                "dash": DASHES[labels.index(curve.label) % len(DASHES)],
                "name": f"trial {curve.trial}, {curve.label}",
                "more": f' data-trial="{curve.trial}"'
                + ("" if curve.trial in chosen else ' class="left-out"'),
            },
        )
        for k, curve in enumerate(curves)
    ]
    force_and_gap(picture, time_scale(curves, 36, picture.width - 10), curves, drawn)
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
    x = time_scale([curve], 2, width - 2)
    values = curve.values("force_n", x.low, x.high)
    y = reaching([force for _, force in values], height - 3, 3, zero=True)
    picture.line(
        [(x(t), y(force)) for t, force in values], INKS[k % len(INKS)], dash=DASHES[label % len(DASHES)]
    )
    name = f"{curve.trial} {curve.label}"
    checked, peak = " checked" if chosen else "", peak_in_words([curve])
    return (
        f'<label><input type="checkbox" value="{curve.trial}"{checked}> {escape(name)}'
        f"{picture.svg(f'trial {name}: {peak}')}<span>{peak}</span></label>"
    )
