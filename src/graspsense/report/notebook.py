"""What a notebook shows of a value: short HTML that takes its colours from the notebook, light or dark."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from graspsense.core.values.channel import Channel
from graspsense.core.values.features import Features, Prediction, certainty_words
from graspsense.core.values.trace import Trace
from graspsense.core.values.trial import Trial
from graspsense.core.values.units import quantity
from graspsense.evaluation.results import Evaluation
from graspsense.report.further_channels import channel_figures
from graspsense.report.grasp_curve import grasp_curve
from graspsense.report.html import paragraph, table
from graspsense.report.tactile import tactile_figures
from graspsense.report.trace_plot import plot as plot
from graspsense.report.traces import one_grasp

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
    """Return what a notebook shows of a trial, a trace, features, a prediction or an evaluation."""
    match value:
        case Trial():
            return trial_html(value)
        case Trace():
            return _pictures(value, ())
        case Features():
            return features_html(value)
        case Prediction():
            return prediction_html(value)
        case Evaluation():
            return evaluation_html(value)
    raise TypeError(f"there is no picture of a {type(value).__name__}")


def features_html(features: Features) -> str:
    """Return the features as a table, each missing one with its reason."""
    shown, more = features.shown()
    rows = [(name, quantity(value, unit), features.reasons.get(name, "")) for name, value, unit in shown]
    rows += [(more, "", "")] if more else []
    header = ("feature", "value", "why it is missing")[: 3 if features.reasons else 2]
    return table("Features", header, [row[: len(header)] for row in rows], captioned=False)


def prediction_html(prediction: Prediction) -> str:
    """Return the label, the most probable classes where they are calibrated, the reasons and the warnings."""
    known = ((label, share) for label, share in prediction.probabilities.items() if share >= LEAST_SHOWN)
    likely = sorted(known, key=lambda pair: -pair[1])[:5]
    certainty = f", {prediction.certainty_in_words}" if prediction.certainty_in_words else ""
    parts = [f"<h4>{escape(f'predicted: {prediction.label}{certainty}')}</h4>"]
    if prediction.set_in_words:
        parts.append(paragraph(f"set: {prediction.set_in_words}"))
    if likely and prediction.calibrated:
        figures = {prediction.label: prediction.certainty_figure}
        rows = [(label, figures.get(label) or certainty_words(share)) for label, share in likely]
        parts.append(table("Classes", ("class", "probability"), rows, captioned=False))
    parts += [paragraph(reason.words) for reason in prediction.because]
    parts += [paragraph(f"warning: {warning}") for warning in prediction.warnings]
    if prediction.model:
        parts.append(paragraph(f"model: {prediction.model}"))
    return "".join(parts)


def trial_html(trial: Trial) -> str:
    """Return outcome, warnings, curve, features and prediction of a trial."""
    labels = ", ".join(f"{key} {value}" for key, value in trial.run.labels.items())
    reason = f": {trial.reason}" if trial.reason else ""
    ended = f"{trial.outcome.words}{reason}" + f" ({labels})" * bool(labels)
    parts = [f"<h4>{escape(ended)}</h4>"]
    parts += [paragraph(f"warning: {warning}") for warning in trial.warnings]
    parts += [_pictures(trial.trace, trial.device.channels), features_html(trial.features)]
    if trial.prediction is not None:
        parts.append(prediction_html(trial.prediction))
    components = ", ".join(trial.run.components.values())
    parts.append(paragraph(f"{trial.device.name}, seed {trial.run.seed}: {components}"))
    return "".join(parts)


def evaluation_html(evaluation: Evaluation) -> str:
    """Return rate and warnings of an evaluation, with a table of the rates under all protocols and controls."""
    rows = [
        (
            name,
            "not measured" if measurement.rate is None else measurement.rate.words,
            measurement.reason or measurement.what,
        )
        for name, measurement in {**evaluation.protocols, **evaluation.controls}.items()
    ]
    parts = [f"<h4>{escape(evaluation.words)}</h4>"]
    parts += [paragraph(f"warning: {warning}") for warning in evaluation.warnings]
    header = ("protocol or control", "rate", "what it is")
    return "".join([*parts, table("Rates", header, rows, captioned=False)])


def _pictures(trace: Trace, channels: Sequence[Channel]) -> str:
    """Return a grasp, its tactile arrays and its further channels, as a page draws them."""
    grasp = one_grasp(grasp_curve(trace, "an object", 0), trace.words) or paragraph(trace.words)
    figures = [grasp, *tactile_figures(trace, channels), *channel_figures(trace, channels)]
    style = ";".join(f"{name}:{colour}" for name, colour in COLOURS.items())
    return f'<div style="{style};max-width:420px;font-family:sans-serif">{"".join(figures)}</div>'
