"""Pictures of measurements: grasps over time, drawn over each other by class, and the features of every label."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import class_of
from graspsense.core.values.errors import counted
from graspsense.core.values.label_text import natural_order
from graspsense.core.values.signals import Phase
from graspsense.core.values.units import display_unit, in_words, without_underscores
from graspsense.report.grasp_curve import GraspCurve, peak_in_words
from graspsense.report.html import figure, folded, panels, table
from graspsense.report.moments import OTHER_PHASE, PHASE_COLOURS, phase_spans
from graspsense.report.svg import DASHES, INKS, QUIET, SIZE, TEXT, AxisScale, Picture, lines_within, reaching

STATES: Final = 8
"""Largest number of line styles in one picture."""
LABEL: Final = 150.0
"""Room for a line of a label beside a picture."""
DRAWN: Final = 150
"""Largest number of dots per label. If there are more trials, every n-th is drawn."""
PHASES: Final = {phase: f"var(--{phase},{colour})" for phase, colour in PHASE_COLOURS.items()}
OTHER: Final = f"var(--phase,{OTHER_PHASE})"
FORCE, GAP = (168.0, 40.0), (300.0, 208.0)
"""Lower and upper edge of the two plots in a picture of grasps."""
BELOW: Final = 352.0
"""Where a picture ends below its axes, or a legend begins."""


def force_and_gap(
    picture: Picture,
    x: AxisScale,
    curves: Sequence[GraspCurve],
    drawn: Iterable[tuple[GraspCurve, Mapping[str, Any]]],
) -> None:
    """Draw the forces of grasps over time above their gaps, on axes that show all of `curves`.

    With each curve that is drawn go arguments of `Picture.line`; without a name, force and gap are read out as such.
    """
    lines = list(drawn)
    time = "seconds" if curves[0].time_unit == "s" else curves[0].time_unit
    picture.x_axis(x, FORCE[1], GAP[0], f"{time} since the squeeze began")
    for column, what, unit, (bottom, top) in (
        ("force_n", curves[0].force, "N", FORCE),
        ("gap_mm", "gap", "mm", GAP),
    ):
        values = [value for curve in curves for _, value in curve.values(column, x.low, x.high)]
        y = reaching(values, bottom, top, zero=column == "force_n")
        picture.y_axis(y, x.start, x.end, f"{what}, {unit}")
        with picture.plot(x, y, top, bottom):
            for curve, how in lines:
                points = [(x(t), y(value)) for t, value in curve.values(column, x.low, x.high)]
                picture.line(points, **{**how, "name": f"{how.get('name', what)}, {unit}"})


def time_scale(curves: Sequence[GraspCurve], start: float, end: float) -> AxisScale:
    """Return the axis of the times from shortly before the contact on."""
    times = [t for curve in curves for t in curve.shown_times]
    return AxisScale(min(times, default=0.0), max(times, default=1.0), start, end)


def traces_by_class(grasps: Sequence[GraspCurve]) -> str:
    """Return one figure per class: force and gap over time, one line per grasp, states by colour and dash."""
    grasps = [grasp.until_release() for grasp in grasps]
    classes: dict[str, list[GraspCurve]] = {}
    for grasp in grasps:
        classes.setdefault(class_of(grasp.label), []).append(grasp)
    if not any(grasp.shown_times for grasp in grasps):
        return ""
    return panels([_traces(name, classes[name], grasps) for name in natural_order(classes)])


def _traces(name: str, grasps: Sequence[GraspCurve], all_grasps: Sequence[GraspCurve]) -> str:
    """Return the figure of a class, on the axes of all classes."""
    states = list(dict.fromkeys(grasp.label for grasp in grasps))[:STATES]
    picture = Picture(BELOW + 15 * len(states))
    picture.title(name)
    peaks = []
    drawn: list[tuple[GraspCurve, Mapping[str, Any]]] = []
    for k, label in enumerate(states):
        state, style = (
            without_underscores(label.partition(":")[2] or label),
            {"ink": INKS[k], "dash": DASHES[k]},
        )
        of_state = [grasp for grasp in grasps if grasp.label == label]
        drawn += [
            (grasp, {**style, "width": 1.4, "name": f"{state} (trial {grasp.trial})"}) for grasp in of_state
        ]
        y = BELOW + 8 + 15 * k
        picture.line([(36, y - 4), (66, y - 4)], width=2, **style)
        picture.text(72, y, state)
        peaks.append(f"{state} {peak_in_words(of_state)}")
    force_and_gap(picture, time_scale(all_grasps, 36, picture.width - 10), all_grasps, drawn)
    words = f"Force and gap over time for {counted(len(grasps), 'grasp')} of {name}: {', '.join(peaks)}"
    return figure(picture.svg(words, grasps[0].time_unit), f"{name}: one line per grasp.")


def one_grasp(grasp: GraspCurve, caption: str) -> str:
    """Return a figure of one grasp from its start: force and gap, with the phases behind them."""
    t = [time for time in grasp.t_s if time is not None]
    if not t:
        return ""
    picture = Picture(BELOW)
    x_scale = AxisScale(t[0], t[-1], 36, picture.width - 10)
    durations = _phases(picture, grasp, t, x_scale)
    force_and_gap(picture, x_scale, [grasp], [(grasp, {"ink": INKS[0], "width": 2})])
    words = (
        f"One grasp of {grasp.label} over time, force above and gap below. Phases: {', '.join(durations)} "
        f"{grasp.time_unit}"
    )
    return figure(picture.svg(words, grasp.time_unit), caption)


def _phases(picture: Picture, grasp: GraspCurve, t: Sequence[float], x_scale: AxisScale) -> list[str]:
    """Draw the phases behind the lines with their legend, and return the duration of each in words."""
    durations = []
    phases = np.array([Phase[name.upper()] for name in grasp.phase[: len(t)]])
    with picture.plot(x_scale, None, FORCE[1], GAP[0]):
        for phase, begin, end in phase_spans(np.array(t), phases):
            left, colour = x_scale(begin), PHASES.get(phase, OTHER)
            picture.box(left, FORCE[1], x_scale(end) - left, GAP[0] - FORCE[1], colour)
            durations.append(f"{phase} for {end - begin:.2f}")
    for k, phase in enumerate(dict.fromkeys(grasp.phase)):
        x = 36 + 80.0 * k
        picture.box(x, BELOW - 12, 12, 10, PHASES.get(phase, OTHER), QUIET)
        picture.text(x + 16, BELOW - 3, phase)
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
    by_label: dict[str, list[float]] = {label: [] for label in natural_order(labels)}
    for label, value in zip(labels, column, strict=True):
        if value is not None:
            by_label[label].append(factor * value)
    missing = sum(value is None for value in column)
    left = 12 + 6.6 * max(len(line) for label in by_label for line in _label_lines(label))
    pitch = 19 if all(len(_label_lines(label)) == 1 for label in by_label) else 24
    bottom = 34.0 + pitch * len(by_label)
    picture = Picture(bottom + 34)
    scale = reaching([v for values in by_label.values() for v in values], min(left, 165), picture.width - 12)
    picture.title(title)
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
    lines = lines_within(label, LABEL)
    name, colon, state = label.partition(":")
    if len(lines) > 1 and colon and max(len(lines_within(part, LABEL)) for part in (name, state)) == 1:
        return [name + colon, state]
    return lines if len(lines) < 3 else [lines[0], f"{lines[1][:-1]}…"]
