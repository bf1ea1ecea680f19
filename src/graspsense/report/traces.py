"""What was felt: grasps over time, all of a class laid over each other, and the features of every label."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from graspsense.report.html import figure, folded, panels, table
from graspsense.report.svg import DASHES, GRID, INKS, QUIET, Picture, Scale, number, reaching
from graspsense.report.units import for_people, in_a_line

MEANING: Final = {
    "p_first": "how far apart the fingertips are when both have touched",
    "p_steady": "how far apart they are once nothing moves any more",
    "f_steady": "the force of a fingertip then",
    "delta_t": "how long it takes from the touch to rest",
    "dp_dt": "how fast the gap changes in that time",
    "df_dt": "how fast the force rises in that time",
}
"""Features that a page can explain: those of Table I of Chitta, Piccoli and Sturm (ICRA 2010)."""
STATES: Final = 8
"""Lines that one picture can tell apart."""
DRAWN: Final = 150
"""Trials of a label that are drawn as dots; of more, every so manieth."""
PHASES: Final = {"approach": "#e9eff6", "squeeze": "#fbdcb4", "hold": "#c9e6cf"}
OTHER_PHASE: Final = "#f3f3f3"
"""Phases of a grasp, behind its lines; each is named as well."""


def class_of(label: str) -> str:
    """Return what is before the colon."""
    return label.partition(":")[0]


def traces_by_class(grasps: Sequence[Mapping[str, Any]]) -> str:
    """Return a figure a class: the force of its grasps over time, a line a grasp, states by colour and dash."""
    classes: dict[str, list[Mapping[str, Any]]] = {}
    for grasp in grasps:
        classes.setdefault(class_of(grasp["label"]), []).append(grasp)
    grasps = [_without_release(grasp) for grasp in grasps]
    classes = {name: [grasp for grasp in grasps if class_of(grasp["label"]) == name] for name in classes}
    times = [t for grasp in grasps for t in _shown_times(grasp)]
    forces = [f for grasp in grasps for f in grasp["force_n"] if f is not None]
    gaps = [
        gap
        for grasp in grasps
        for t, gap in zip(grasp["t_s"], grasp["gap_mm"], strict=True)
        if gap is not None and t >= min(_shown_times(grasp))
    ]
    if not times:
        return ""
    return panels(
        [_traces(name, of, (min(times), max(times)), forces, gaps) for name, of in sorted(classes.items())]
    )


def _without_release(grasp: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a grasp up to where the fingers open again."""
    end = grasp["phase"].index("release") if "release" in grasp["phase"] else len(grasp["phase"])
    return {
        **grasp,
        **{name: grasp[name][:end] for name in ("t_s", "gap_mm", "force_n", "phase")},
    }


def _shown_times(grasp: Mapping[str, Any]) -> list[float]:
    """Return the times from shortly before the contact on: what comes earlier is the way through empty air."""
    return [t for t in grasp["t_s"] if t is not None and t >= BEFORE_S] or list(grasp["t_s"])


BEFORE_S: Final = -0.3


def _traces(
    name: str,
    grasps: Sequence[Mapping[str, Any]],
    times: tuple[float, float],
    forces: Sequence[float],
    gaps: Sequence[float],
) -> str:
    states = list(dict.fromkeys(grasp["label"] for grasp in grasps))[:STATES]
    legend = 348.0
    picture = Picture(legend + 15 * len(states) - 8)
    x_scale = Scale(times[0], times[1], 36, picture.width - 10)
    picture.text(2, 14, name, bold=True, size=13)
    force = reaching(forces, 172, 40, zero=True)
    gap = reaching(gaps, 300, 210)
    unit = grasps[0].get("time_unit", "s")
    picture.x_axis(x_scale, 40, 300, f"{'seconds' if unit == 's' else unit} since both pads touched")
    picture.y_axis(force, 36, picture.width - 10, "force, N")
    picture.y_axis(gap, 36, picture.width - 10, "gap, mm")
    for grasp in grasps:
        if grasp["label"] not in states:
            continue
        k = states.index(grasp["label"])
        for column, scale in (("force_n", force), ("gap_mm", gap)):
            points = [
                (x_scale(t), scale(v))
                for t, v in zip(grasp["t_s"], grasp[column], strict=True)
                if t is not None and v is not None and times[0] <= t <= times[1]
            ]
            picture.line(points, INKS[k], width=1.4, dash=DASHES[k])
    told = []
    for k, label in enumerate(states):
        y = legend + 15 * k
        picture.line([(36, y - 4), (66, y - 4)], INKS[k], width=2, dash=DASHES[k])
        state = label.partition(":")[2] or label
        picture.text(72, y, in_a_line(state))
        peaks = [
            max((f for f in grasp["force_n"] if f is not None), default=math.nan)
            for grasp in grasps
            if grasp["label"] == label
        ]
        told.append(f"{in_a_line(state)} up to {number(max(peaks))} N")
    words = f"Force and gap over time for {len(grasps)} grasps of {name}: {', '.join(told)}"
    return figure(picture.svg(words), f"{name}: every line is one grasp.")


def one_grasp(grasp: Mapping[str, Any], caption: str) -> str:
    """Return a figure of one grasp from its beginning on: gap, force, and the phase behind them."""
    t = [one for one in grasp["t_s"] if one is not None]
    if not t:
        return ""
    named = list(dict.fromkeys(grasp["phase"]))
    picture = Picture(334)
    x_scale = Scale(t[0], t[-1], 36, picture.width - 10)
    gap = reaching([v for v in grasp["gap_mm"] if v is not None], 140, 44)
    force = reaching([v for v in grasp["force_n"] if v is not None], 280, 176, zero=True)
    begun, told = 0, []
    phases = grasp["phase"]
    for k in range(1, len(phases) + 1):
        if k < len(phases) and phases[k] == phases[begun]:
            continue
        left, right = x_scale(t[begun]), x_scale(t[min(k, len(t) - 1)])
        picture.box(left, 24, right - left, 256, PHASES.get(phases[begun], OTHER_PHASE), GRID)
        told.append(f"{phases[begun]} for {t[min(k, len(t) - 1)] - t[begun]:.2f}")
        begun = k
    for k, phase in enumerate(named):
        x = 36 + 80.0 * k
        picture.box(x, 322, 12, 10, PHASES.get(phase, OTHER_PHASE), QUIET)
        picture.text(x + 16, 331, phase)
    unit = grasp.get("time_unit", "s")
    picture.x_axis(x_scale, 24, 280, f"{'seconds' if unit == 's' else unit} since both pads touched")
    picture.y_axis(gap, 36, picture.width - 10, "gap, mm")
    picture.y_axis(force, 36, picture.width - 10, "force, N")
    for column, scale, ink in (("gap_mm", gap, INKS[0]), ("force_n", force, INKS[1])):
        points = [
            (x_scale(one), scale(v))
            for one, v in zip(grasp["t_s"], grasp[column], strict=True)
            if one is not None and v is not None
        ]
        picture.line(points, ink, width=2)
    words = f"One grasp of {grasp['label']} over time, gap above and force below. Phases: {', '.join(told)} {unit}"
    return figure(picture.svg(words), caption)


def features_by_class(
    features: Sequence[tuple[str, str]], labels: Sequence[str], values: Sequence[Sequence[float | None]]
) -> str:
    """Return a figure a feature: a row a label, a dot a trial, a bar from the first to the third quartile."""
    names = sorted(set(labels))
    return panels(
        [
            _feature(name, unit, names, labels, [row[k] for row in values])
            for k, (name, unit) in enumerate(features)
        ]
    )


def _feature(
    name: str, unit: str, names: Sequence[str], labels: Sequence[str], column: Sequence[float | None]
) -> str:
    shown, factor = for_people(unit)
    of: dict[str, list[float]] = {label: [] for label in names}
    missing = 0
    for label, value in zip(labels, column, strict=True):
        if value is None:
            missing += 1
        else:
            of[label].append(factor * value)
    left = 12 + 6.1 * max(map(len, names))
    bottom = 34.0 + 19 * len(names)
    picture = Picture(bottom + 34)
    scale = reaching([one for some in of.values() for one in some], min(left, 165), picture.width - 12)
    picture.text(2, 14, f"{name}" + (f", {shown}" if shown else ""), bold=True, size=13)
    picture.x_axis(scale, 24, bottom, shown or "value")
    rows: list[tuple[str, ...]] = []
    for k, label in enumerate(names):
        y = 38.0 + 19 * k
        picture.text(scale.start - 6, y + 4, _short(label), at="end")
        some = sorted(of[label])
        if not some:
            picture.text(scale.start + 4, y + 4, "missing in all", ink=QUIET)
            rows.append((label, "0", "", "", ""))
            continue
        ink = INKS[list(dict.fromkeys(map(class_of, names))).index(class_of(label)) % len(INKS)]
        step = max(1, math.ceil(len(some) / DRAWN))
        # Dots of one row lie in three lines, in turn, so that they do not hide each other.
        picture.dots([(scale(one), y + 4 * (i % 3 - 1)) for i, one in enumerate(some[::step])], ink)
        low, middle, high = (_quantile(some, q) for q in (0.25, 0.5, 0.75))
        picture.line([(scale(low), y), (scale(high), y)], "#1a1a1a", width=2.5)
        picture.line([(scale(middle), y - 6), (scale(middle), y + 6)], "#1a1a1a", width=2.5)
        rows.append((label, str(len(some)), *(f"{one:.4g}" for one in (low, middle, high))))
    told = "; ".join(f"{row[0]} {row[3]}" for row in rows if row[3])
    absent = f" Missing in {missing} of {len(column)} trials." if missing else ""
    words = f"{name} of every label. Medians{f' in {shown}' if shown else ''}: {told}.{absent}"
    numbers = table(
        f"{name}{f', {shown}' if shown else ''}",
        ("label", "trials", "1st quartile", "median", "3rd quartile"),
        rows,
        1,
    )
    caption = f"{name}: {MEANING[name]}.{absent}" if name in MEANING else f"{name}.{absent}"
    return f"<div>{figure(picture.svg(words), caption)}{folded(f'{name} in numbers', numbers)}</div>"


def _short(label: str) -> str:
    return label if len(label) <= 26 else label[:25] + "…"


def _quantile(ordered: Sequence[float], share: float) -> float:
    place = share * (len(ordered) - 1)
    below = math.floor(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])
