"""What a notebook shows of a value: short HTML that takes its colours from the notebook, light or dark."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from graspsense.core.values.channel import Channel
from graspsense.core.values.display import sentence, table
from graspsense.core.values.features import Features, Prediction, certainty_words
from graspsense.core.values.trace import Trace
from graspsense.core.values.trial import Trial
from graspsense.core.values.units import display_unit, quantity
from graspsense.report.further_channels import channel_figures, envelope
from graspsense.report.moments import contact_time, phase_spans, shown_from
from graspsense.report.svg import INKS, AxisScale, Picture, reaching
from graspsense.report.tactile import tactile_figures
from graspsense.report.trace_plot import plot as plot
from graspsense.report.traces import OTHER_PHASE, PHASES

LEAST_SHOWN: Final = 0.005
"""A class that is less probable than this is not listed."""
COLOURS: Final = {
    "--text": "currentColor",
    "--quiet": "currentColor",
    "--ground": "transparent",
    "--grid": "#8884",
    "--ink0": "#3b8ad9",
    "--ink1": "#d9772b",
    "--ink2": "#8a8a8a",
    "--approach": "transparent",
    "--squeeze": "#e8963c33",
    "--hold": "#4caf6a33",
    "--phase": "#9a9a9a33",
}
"""The colours of pictures of a page, so that they stand out from white and from black."""


def html(value: object) -> str:
    """Return what a notebook shows of a trial, a trace, features or a prediction."""
    match value:
        case Trial():
            return trial_html(value)
        case Trace():
            return sentence(value.words) + _pictures(value, ())
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
    parts += [_pictures(trial.trace, trial.device.channels), features_html(trial.features)]
    if trial.prediction is not None:
        parts.append(prediction_html(trial.prediction))
    components = ", ".join(trial.run.components.values())
    parts.append(sentence(f"{trial.device.name}, seed {trial.run.seed}: {components}"))
    return "".join(parts)


def _pictures(trace: Trace, channels: Sequence[Channel]) -> str:
    """Return the curve of a grasp, its tactile arrays and its further channels, as a page draws them."""
    figures = [_curve(trace), *tactile_figures(trace, channels), *channel_figures(trace, channels)]
    style = ";".join(f"{name}:{colour}" for name, colour in COLOURS.items())
    return f'<div style="{style};max-width:420px;font-family:sans-serif">{"".join(figures)}</div>'


def _curve(trace: Trace) -> str:
    """Return pad forces and gap over time, with the phases behind them."""
    start, unit = shown_from(trace), trace.units
    t = trace.t_s[start:] - (contact_time(trace) or 0.0)
    shown, factor = display_unit(unit["gap"])
    picture = Picture(314.0)
    right = picture.width - 10.0
    x = AxisScale(float(t[0]), float(t[-1]), 36.0, right) if len(t) else AxisScale(0.0, 1.0, 36.0, right)
    for name, begin, end in phase_spans(t, trace.phase[start:]):
        left, width = x(begin), x(end) - x(begin)
        picture.box(left, 30.0, width, 250.0, PHASES.get(name, OTHER_PHASE))
        if width > 7.0 * len(name):
            picture.text(left + width / 2.0, 166.0, name, anchor="middle")
    pads = {"left pad": trace.force_left_n[start:], "right pad": trace.force_right_n[start:]}
    forces = [*pads["left pad"].tolist(), *pads["right pad"].tolist(), 1.0]
    gaps = factor * trace.gap_m[start:]
    force, gap = reaching(forces, 150.0, 30.0, zero=True), reaching(gaps.tolist(), 280.0, 186.0)
    picture.x_axis(x, 30.0, 280.0, "")
    picture.y_axis(force, 36.0, right, f"force, {unit['force_left']}")
    picture.y_axis(gap, 36.0, right, f"gap, {shown}")
    lines = [*((name, values, force) for name, values in pads.items()), ("gap", gaps, gap)]
    for ink, (name, values, scale) in zip(INKS, lines, strict=False):
        picture.line([(x(t_s), scale(value)) for t_s, value in envelope(t, values)], ink, name=name)
    for place, name, ink in ((right - 70.0, "left pad", INKS[0]), (right, "right pad", INKS[1])):
        picture.text(place, 14.0, name, anchor="end", ink=ink)
    picture.text(right, 310.0, f"time, {unit['t']}", anchor="end")
    return picture.svg(trace.words, unit["t"])
