"""What a notebook shows of a value: short HTML that takes its colours from the notebook, light or dark."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from itertools import cycle
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.values.display import sentence, table
from graspsense.core.values.features import Features, Prediction, certainty_words
from graspsense.core.values.trace import SampleTrace, Trace
from graspsense.core.values.trial import Trial
from graspsense.core.values.units import display_unit, quantity, without_underscores
from graspsense.report.moments import array_images, contact_time, images_at, moments, phase_spans, shown_from
from graspsense.report.svg import DASHES
from graspsense.report.trace_plot import plot as plot

if TYPE_CHECKING:
    from graspsense.core.values.trace import Floats

WIDTH, HEIGHT, LEFT_MARGIN, PANEL = 560.0, 264.0, 48.0, 92.0
MOST_DRAWN = 256
"""Of an array with more cells the means of groups of neighbours are drawn."""
POINTS: Final = 300
"""Largest number of points of a line."""
LEAST_SHOWN: Final = 0.005
"""A class that is less probable than this is not listed."""
INKS: Final = ("#3b8ad9", "#d9772b", "#8a8a8a")
"""Left pad, right pad, gap: each stands out from white and from black."""
PHASE_INKS: Final = {"squeeze": "#e8963c", "hold": "#4caf6a", "release": "#9a9a9a"}


def html(value: object) -> str:
    """Return what a notebook shows of a trial, a trace, features or a prediction."""
    match value:
        case Trial():
            return trial_html(value)
        case Trace():
            return trace_html(value)
        case Features():
            return features_html(value)
        case Prediction():
            return prediction_html(value)
    raise TypeError(f"there is no picture of a {type(value).__name__}")


def features_html(features: Features) -> str:
    """Return the features as a table, each missing one with its reason."""
    shown, more = features.shown()
    rows = [(name, quantity(value, unit), features.reasons.get(name, "")) for name, value, unit in shown]
    rows += [(more, "", "")] if more else []
    if not features.reasons:
        return table(("feature", "value"), [row[:2] for row in rows])
    return table(("feature", "value", "why it is missing"), rows)


def prediction_html(prediction: Prediction) -> str:
    """Return the label, the most probable classes where they are calibrated, the reasons and the warnings."""
    known = ((label, share) for label, share in prediction.probabilities.items() if share >= LEAST_SHOWN)
    likely = sorted(known, key=lambda pair: -pair[1])[:5]
    certainty = f", {prediction.certainty_in_words}" if prediction.certainty_in_words else ""
    parts = [sentence(f"predicted: {prediction.label}{certainty}", strong=True)]
    if prediction.set_in_words:
        parts.append(sentence(f"set: {prediction.set_in_words}"))
    if likely and prediction.calibrated:
        figures = {prediction.label: prediction.certainty_figure}
        rows = [(label, figures.get(label) or certainty_words(share)) for label, share in likely]
        parts.append(table(("class", "probability"), rows))
    parts += [sentence(reason.words) for reason in prediction.because]
    parts += [sentence(f"warning: {warning}") for warning in prediction.warnings]
    if prediction.model:
        parts.append(sentence(f"model: {prediction.model}"))
    return "".join(parts)


def trial_html(trial: Trial) -> str:
    """Return outcome, warnings, curve, features and prediction of a trial."""
    labels = ", ".join(f"{key} {value}" for key, value in trial.run.labels.items())
    reason = f": {trial.reason}" if trial.reason else ""
    parts = [sentence(f"{trial.outcome.words}{reason}" + f" ({labels})" * bool(labels), strong=True)]
    parts += [sentence(f"warning: {warning}") for warning in trial.warnings]
    parts += [
        trace_svg(trial.trace),
        samples_html(trial.trace),
        arrays_html(trial.trace),
        features_html(trial.features),
    ]
    if trial.prediction is not None:
        parts.append(prediction_html(trial.prediction))
    components = ", ".join(trial.run.components.values())
    parts.append(sentence(f"{trial.device.name}, seed {trial.run.seed}: {components}"))
    return "".join(parts)


def trace_html(trace: Trace) -> str:
    """Return a trace in words, its curves and its arrays."""
    return sentence(trace.words) + trace_svg(trace) + samples_html(trace) + arrays_html(trace)


def trace_svg(trace: Trace) -> str:
    """Return pad forces and gap over time, with the phases behind them."""
    start = shown_from(trace)
    contact = contact_time(trace) or 0.0
    t = trace.t_s[start:] - contact
    shown, factor = display_unit(trace.units["gap"])
    forces = [trace.force_left_n[start:], trace.force_right_n[start:]]
    top, bottom = 24.0, 24.0 + PANEL + 22.0
    parts = [
        f'<text x="{LEFT_MARGIN}" y="14" fill="currentColor">force, {escape(trace.units["force_left"])}: '
        f'<tspan fill="{INKS[0]}">left pad</tspan>, <tspan fill="{INKS[1]}">right pad</tspan></text>',
        f'<text x="{LEFT_MARGIN}" y="{bottom - 6}" fill="currentColor">gap, {escape(shown)}</text>',
        *_phases(trace, start, t, top, bottom + PANEL),
        *_panel(t, forces, INKS[:2], top, least=1.0),
        *_panel(t, [factor * trace.gap_m[start:]], INKS[2:], bottom),
        *_time_labels(t, bottom + PANEL + 26, trace.units["t"]),
    ]
    return _svg(parts, HEIGHT, trace.words)


def arrays_html(trace: Trace) -> str:
    """Return the cells of every tactile array at contact, peak and rest: a row for each moment, darker for more."""
    times = moments(trace)
    parts = []
    for name, images in array_images(trace).items():
        shown = images_at(images, 1.0, times)
        fewer = {moment: _means(cells) for moment, cells in shown.values.items()}
        known = np.concatenate([cells[np.isfinite(cells)] for cells in fewer.values()] or [np.empty(0)])
        if not len(known):
            continue
        low, high = float(known.min()), float(known.max())
        cell = min(16.0, (WIDTH - LEFT_MARGIN) / max(map(len, fewer.values())))
        change = "change since before contact" if shown.relative else "values"
        words = f"{name}: {change}, by cell, {low:.4g} to {high:.4g}"
        drawn = [f'<text x="0" y="11" fill="currentColor">{escape(words)}</text>']
        for row, (moment, cells) in enumerate(fewer.items()):
            y = 18.0 + 14.0 * row
            drawn.append(f'<text x="0" y="{y + 10:g}" fill="currentColor">{moment}</text>')
            drawn += [
                f'<rect x="{LEFT_MARGIN + k * cell:.1f}" y="{y:g}" width="{cell:.1f}" height="13" fill="{INKS[0]}" '
                f'fill-opacity="{(value - low) / ((high - low) or 1.0):.2f}" stroke="#8a8a8a" stroke-width="0.3"/>'
                for k, value in enumerate(cells.tolist())
                if math.isfinite(value)
            ]
        parts.append(_svg(drawn, 18.0 + 14.0 * len(shown.values) + 2.0, words))
    return "".join(parts)


def _means(cells: Floats) -> Floats:
    """Return the cells, or the means of groups of neighbours where there are too many to draw each."""
    if len(cells) <= MOST_DRAWN:
        return cells
    return np.array([part.mean() for part in np.array_split(cells, MOST_DRAWN)])


def samples_html(trace: Trace) -> str:
    """Return each fast channel over time, a line for each axis."""
    parts = []
    start = float(trace.t_s[shown_from(trace)]) if len(trace) else 0.0
    for name, signal in trace.signals.items():
        if isinstance(signal, SampleTrace) and len(signal.t_s):
            shown = signal.t_s >= start
            t, values = signal.t_s[shown] - (contact_time(trace) or 0.0), signal.values[shown]
            if len(t):
                words = f"{without_underscores(name)}, {signal.values.shape[1]} axes"
                drawn = [f'<text x="{LEFT_MARGIN}" y="14" fill="currentColor">{escape(words)}</text>']
                drawn += _panel(
                    t, list(values.T), [INKS[k % len(INKS)] for k in range(values.shape[1])], 24.0
                )
                parts.append(_svg(drawn, 24.0 + PANEL + 6.0, words))
    return "".join(parts)


def _svg(drawn: Sequence[str], height: float, words: str) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH:g} {height:g}" role="img" aria-label="{escape(words)}" '
        f'style="display:block;max-width:{WIDTH:g}px;font:11px sans-serif" xmlns="http://www.w3.org/2000/svg">'
        f"{''.join(drawn)}</svg>"
    )


def _x(t: Floats, value: float) -> float:
    span = float(t[-1] - t[0]) or 1.0
    return LEFT_MARGIN + (WIDTH - LEFT_MARGIN - 8.0) * (value - float(t[0])) / span


def _panel(
    t: Floats, lines: Sequence[Floats], inks: Sequence[str], top: float, least: float = 0.0
) -> Iterable[str]:
    """Yield the lines of one panel, and the values at its lower and upper edge. `least`: its least upper edge."""
    known = np.concatenate([line[~np.isnan(line)] for line in lines])
    low, high = (float(known.min()), max(float(known.max()), least)) if len(known) else (0.0, 1.0)
    for value, y in ((high, top + 8.0), (low, top + PANEL)):
        yield f'<text x="{LEFT_MARGIN - 5}" y="{y:g}" text-anchor="end" fill="currentColor">{value:.3g}</text>'
    every = np.linspace(0, len(t) - 1, min(len(t), POINTS)).round().astype(int)
    for line, ink, dash in zip(lines, inks, cycle(DASHES), strict=False):
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        points = [
            f"{_x(t, float(t[k])):.1f},{top + PANEL * (high - float(line[k])) / ((high - low) or 1.0):.1f}"
            for k in every
            if not np.isnan(line[k])
        ]
        if points:
            yield f'<polyline points="{" ".join(points)}" fill="none" stroke="{ink}" stroke-width="1.6"{dashes}/>'


def _phases(trace: Trace, start: int, t: Floats, top: float, bottom: float) -> Iterable[str]:
    for phase, begin, end in phase_spans(t, trace.phase[start:]):
        name, left, right = phase.name.lower(), _x(t, begin), _x(t, end)
        if name in PHASE_INKS:
            yield (
                f'<rect x="{left:.1f}" y="{top:g}" width="{right - left:.1f}" height="{bottom - top:g}" '
                f'fill="{PHASE_INKS[name]}" fill-opacity="0.18"><title>{name}</title></rect>'
            )
        if right - left > 7.0 * len(name):
            middle = 0.5 * (left + right)
            yield f'<text x="{middle:.1f}" y="{bottom + 13:g}" text-anchor="middle" fill="currentColor">{name}</text>'


def _time_labels(t: Floats, y: float, unit: str) -> Iterable[str]:
    if len(t):
        for value, anchor in ((float(t[0]), "start"), (float(t[-1]), "end")):
            text = f"{value:.3g} {escape(unit)}"
            yield f'<text x="{_x(t, value):.1f}" y="{y:g}" text-anchor="{anchor}" fill="currentColor">{text}</text>'
