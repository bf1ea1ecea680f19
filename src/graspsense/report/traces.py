"""Pictures of measurements: grasps over time, drawn over each other by class, and the features of every label."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import frozen

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import class_of
from graspsense.core.values.errors import counted
from graspsense.core.values.units import display_unit, in_words, without_underscores
from graspsense.report.grasp_curve import GraspCurve, peak_in_words
from graspsense.report.html import figure, folded, panels, table
from graspsense.report.svg import DASHES, INKS, QUIET, SIZE, TEXT, AxisScale, Picture, reaching

STATES: Final = 8
"""Largest number of line styles in one picture."""
LABEL: Final = 26
"""Characters of a label beside a picture in one line."""
DRAWN: Final = 150
"""Largest number of dots per label. If there are more trials, every n-th is drawn."""
PHASES: Final = {
    "approach": "var(--approach,#e9eff6)",
    "squeeze": "var(--squeeze,#fbdcb4)",
    "hold": "var(--hold,#c9e6cf)",
}
OTHER_PHASE: Final = "var(--phase,#f3f3f3)"
"""Background colours of the phases of a grasp; each phase is also named."""


def traces_by_class(grasps: Sequence[GraspCurve]) -> str:
    """Return one figure per class: force and gap over time, one line per grasp, states by colour and dash."""
    grasps = [grasp.until_release() for grasp in grasps]
    classes: dict[str, list[GraspCurve]] = {}
    for grasp in grasps:
        classes.setdefault(class_of(grasp.label), []).append(grasp)
    times = [t for grasp in grasps for t in grasp.shown_times]
    if not times:
        return ""
    axes = _Axes(
        times=(min(times), max(times)),
        forces=[force for grasp in grasps for force in grasp.force_n if force is not None],
        gaps=[
            gap for grasp in grasps for _, gap in grasp.values("gap_mm", min(grasp.shown_times, default=0.0))
        ],
    )
    return panels([_traces(name, curves, axes) for name, curves in sorted(classes.items())])


@frozen
class _Axes:
    """The ranges that the pictures of all classes share."""

    times: tuple[float, float]
    forces: Sequence[float]
    gaps: Sequence[float]


LEGEND_TOP: Final = 348.0


def _traces(name: str, grasps: Sequence[GraspCurve], axes: _Axes) -> str:
    states = list(dict.fromkeys(grasp.label for grasp in grasps))[:STATES]
    picture = Picture(LEGEND_TOP + 15 * len(states) - 8)
    x_scale = AxisScale(*axes.times, 36, picture.width - 10)
    picture.text(2, 14, name, bold=True, size=13)
    force = reaching(axes.forces, 172, 40, zero=True)
    gap = reaching(axes.gaps, 300, 210)
    picture.x_axis(x_scale, 40, 300, f"{grasps[0].time_words} since the squeeze began")
    picture.y_axis(force, 36, picture.width - 10, f"{grasps[0].force}, N")
    picture.y_axis(gap, 36, picture.width - 10, "gap, mm")
    for column, unit, scale, top, bottom in (
        ("force_n", "N", force, 40.0, 172.0),
        ("gap_mm", "mm", gap, 210.0, 300.0),
    ):
        with picture.plot(x_scale, scale, top, bottom):
            for grasp in grasps:
                if grasp.label not in states:
                    continue
                k = states.index(grasp.label)
                points = [(x_scale(t), scale(v)) for t, v in grasp.values(column, *axes.times)]
                state = without_underscores(grasp.label.partition(":")[2] or grasp.label)
                named = f"{state} (trial {grasp.trial}), {unit}"
                picture.line(points, INKS[k], width=1.4, dash=DASHES[k], name=named)
    peaks = _legend(picture, states, grasps)
    words = f"Force and gap over time for {counted(len(grasps), 'grasp')} of {name}: {', '.join(peaks)}"
    return figure(picture.svg(words, grasps[0].time_unit), f"{name}: one line per grasp.")


def _legend(picture: Picture, states: Sequence[str], grasps: Sequence[GraspCurve]) -> list[str]:
    """Draw the legend, and return the peak force of each state in words."""
    peaks = []
    for k, label in enumerate(states):
        y = LEGEND_TOP + 15 * k
        picture.line([(36, y - 4), (66, y - 4)], INKS[k], width=2, dash=DASHES[k])
        state = without_underscores(label.partition(":")[2] or label)
        picture.text(72, y, state)
        peaks.append(f"{state} {peak_in_words(grasp for grasp in grasps if grasp.label == label)}")
    return peaks


def one_grasp(grasp: GraspCurve, caption: str) -> str:
    """Return a figure of one grasp from its start: gap and force, with the phases behind them."""
    t = [time for time in grasp.t_s if time is not None]
    if not t:
        return ""
    picture = Picture(334)
    x_scale = AxisScale(t[0], t[-1], 36, picture.width - 10)
    gap = reaching([v for v in grasp.gap_mm if v is not None], 140, 44)
    force = reaching([v for v in grasp.force_n if v is not None], 280, 176, zero=True)
    durations = _phases(picture, grasp, t, x_scale)
    picture.x_axis(x_scale, 24, 280, f"{grasp.time_words} since the squeeze began")
    picture.y_axis(gap, 36, picture.width - 10, "gap, mm")
    picture.y_axis(force, 36, picture.width - 10, f"{grasp.force}, N")
    for column, scale, ink, named, top, bottom in (
        ("gap_mm", gap, INKS[0], "gap, mm", 44.0, 140.0),
        ("force_n", force, INKS[1], f"{grasp.force}, N", 176.0, 280.0),
    ):
        points = [(x_scale(time), scale(value)) for time, value in grasp.values(column)]
        with picture.plot(x_scale, scale, top, bottom):
            picture.line(points, ink, width=2, name=named)
    words = (
        f"One grasp of {grasp.label} over time, gap above and force below. Phases: {', '.join(durations)} "
        f"{grasp.time_unit}"
    )
    return figure(picture.svg(words, grasp.time_unit), caption)


def _phases(picture: Picture, grasp: GraspCurve, t: Sequence[float], x_scale: AxisScale) -> list[str]:
    """Draw the phases behind the lines with their legend, and return the duration of each in words."""
    start, durations = 0, []
    phases = grasp.phase
    with picture.plot(x_scale, None, 24, 280):
        for k in range(1, len(phases) + 1):
            if k < len(phases) and phases[k] == phases[start]:
                continue
            end = t[min(k, len(t) - 1)]
            colour = PHASES.get(phases[start], OTHER_PHASE)
            picture.band(x_scale(t[start]), x_scale(end), 24, 280, colour)
            durations.append(f"{phases[start]} for {end - t[start]:.2f}")
            start = k
    for k, phase in enumerate(dict.fromkeys(phases)):
        x = 36 + 80.0 * k
        picture.box(x, 322, 12, 10, PHASES.get(phase, OTHER_PHASE), QUIET)
        picture.text(x + 16, 331, phase)
    return durations


def features_by_class(
    features: Sequence[tuple[str, str]], labels: Sequence[str], values: Sequence[Sequence[float | None]]
) -> str:
    """Return one figure per feature: a row per label, a dot per trial, a bar from the first to the third quartile."""
    meanings = feature_meanings([name for name, _ in features])
    return panels(
        [
            _feature(name, unit, meanings.get(name, ""), labels, [row[k] for row in values])
            for k, (name, unit) in enumerate(features)
        ]
    )


def feature_meanings(names: Sequence[str]) -> dict[str, str]:
    """Return what each feature means, in a few words, as the installed feature sets declare it.

    Of sets that share a name, the one that has all of these names counts.
    """
    sets = sorted(
        installed().feature_sets(),
        key=lambda feature_set: set(names) <= {feature.name for feature in feature_set.features or ()},
    )
    return {feature.name: feature.meaning for feature_set in sets for feature in feature_set.features or ()}


def features_table(caption: str, features: Sequence[tuple[str, str]], values: Sequence[float | None]) -> str:
    """Return the features of one grasp with their values, units and meanings."""
    meanings = feature_meanings([name for name, _ in features])
    rows = [
        (name, "missing" if value is None else in_words(value, unit), meanings.get(name, ""))
        for (name, unit), value in zip(features, values, strict=True)
    ]
    return table(caption, ("feature", "value", "meaning"), rows)


def _feature(
    name: str, unit: str, meaning: str, labels: Sequence[str], column: Sequence[float | None]
) -> str:
    shown, factor = display_unit(unit)
    title = f"{name}, {shown}" if shown else name
    by_label: dict[str, list[float]] = {label: [] for label in sorted(set(labels))}
    for label, value in zip(labels, column, strict=True):
        if value is not None:
            by_label[label].append(factor * value)
    missing = sum(value is None for value in column)
    left = 12 + 6.1 * max(len(line) for label in by_label for line in _label_lines(label))
    pitch = 19 if all(len(label) <= LABEL for label in by_label) else 24
    bottom = 34.0 + pitch * len(by_label)
    picture = Picture(bottom + 34)
    scale = reaching([v for values in by_label.values() for v in values], min(left, 165), picture.width - 12)
    picture.text(2, 14, title, bold=True, size=13)
    picture.x_axis(scale, 24, bottom, shown or "value")
    classes = list(dict.fromkeys(map(class_of, by_label)))
    rows = [
        _feature_row(picture, scale, 38.0 + pitch * k, label, sorted(values), classes.index(class_of(label)))
        for k, (label, values) in enumerate(by_label.items())
    ]
    medians = "; ".join(f"{row[0]} {row[3]}" for row in rows if row[3])
    absent = f" Missing in {missing} of {counted(len(column), 'trial')}." if missing else ""
    words = f"{name} of every label. Medians{f' in {shown}' if shown else ''}: {medians}.{absent}"
    header = ("label", "trials", "1st quartile", "median", "3rd quartile")
    numbers = table(title, header, rows, 1)
    caption = f"{name}: {meaning}.{absent}" if meaning else f"{name}.{absent}"
    return f"<div>{figure(picture.svg(words), caption)}{folded(f'{name} in numbers', numbers)}</div>"


def _feature_row(
    picture: Picture, scale: AxisScale, y: float, label: str, values: Sequence[float], colour: int
) -> tuple[str, ...]:
    """Draw the trials of one label, and return its row of the table."""
    lines = _label_lines(label)
    for k, line in enumerate(lines):
        picture.text(
            scale.start - 6,
            y + 4 + 10 * (k - (len(lines) - 1) / 2),
            line,
            anchor="end",
            size=SIZE - len(lines) + 1,
        )
    if not values:
        picture.text(scale.start + 4, y + 4, "missing in all", ink=QUIET)
        return (label, "0", "", "", "")
    step = max(1, math.ceil(len(values) / DRAWN))
    # The dots of a row alternate between three heights, so that they do not hide each other.
    dots = [(scale(value), y + 4 * (i % 3 - 1)) for i, value in enumerate(values[::step])]
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75)).tolist()
    with picture.plot(scale, None, y - 9, y + 9):
        picture.dots(dots, INKS[colour % len(INKS)], label)
        picture.line([(scale(low), y), (scale(high), y)], TEXT, width=2.5)
        picture.line([(scale(middle), y - 6), (scale(middle), y + 6)], TEXT, width=2.5)
    return (label, str(len(values)), *(f"{value:.4g}" for value in (low, middle, high)))


def _label_lines(label: str) -> list[str]:
    """Return a label in one line, or in two if it is long: the class and the state."""
    if len(label) <= LABEL:
        return [label]
    name, colon, state = label.partition(":")
    if not colon or max(len(name), len(state)) > LABEL:
        name, state = label[:LABEL], label[LABEL:]
    return [
        name + colon * (state != label[LABEL:]),
        state if len(state) <= LABEL else f"{state[: LABEL - 1]}…",
    ]
