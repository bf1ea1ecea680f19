"""`graspsense predict`: the predictions of a model for labelled or unlabelled trials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import click

from graspsense.cli.options import refuse_typed
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.sources import SOURCES, source_argument, source_options, to_predict
from graspsense.cli.target_value import predict_value
from graspsense.cli.terminal import (
    Style,
    echo,
    echo_entries,
    echo_entry,
    echo_table,
    prediction_style,
    state_style,
)
from graspsense.core.components.entries import ModelEntry
from graspsense.core.components.registry import installed
from graspsense.core.values.errors import ConfigError, listed
from graspsense.core.values.features import UNKNOWN, Prediction, assumed_units
from graspsense.core.values.label_text import alike_words, natural_order, spelled_alike
from graspsense.evaluation.intervals import RecognitionRate, rate_of
from graspsense.evaluation.json_codec import to_json

if TYPE_CHECKING:
    from graspsense.core.learn.labelled import Labelled

MOST_WITH_REASONS: Final = 1000
"""Largest number of trials whose predictions are given with reasons, which take about a millisecond each."""


@click.command(
    help=f"""Predict the labels of the trials of SOURCE, with probabilities and reasons.

    MODEL is a .json file of `graspsense train`, or the name of a model of a plugin (such as default). If the trials
    have labels, the rate is printed as well; it is meaningful only if the model was trained on other instances. A CSV
    file does not need --label here.

    {SOURCES}""",
)
@click.argument("model")
@source_argument
@source_options
@json_option("Print every prediction with its reasons as JSON.")
def predict(model: str, source: str, **given: Any) -> None:
    """Predict and print."""
    from graspsense.core.learn.copies import learned_from
    from graspsense.core.learn.model_file import load_model
    from graspsense.regression.model import is_regression

    _refuse_swapped(model, source)
    refuse_typed(["features"], "is not for predict: the model says which features it reads")
    if is_regression(model):
        return predict_value(model, source, given)
    asked = load_model(model, installed())
    if given["target_value"]:
        raise click.UsageError(f"--target-value: model {model} predicts a label, not a number")
    table, labelled, notes = to_predict(source, asked.names, given)
    labelled = None if labelled is None else labelled.aimed(asked.target)
    if mismatch := asked.misfit(table):
        raise ConfigError(mismatch)
    provenance = {} if labelled is None else labelled.provenance
    if len(table) > MOST_WITH_REASONS:
        predictions = asked.predictions(table, provenance)
    else:
        predictions = [asked.predict(table.row(i), provenance=provenance) for i in range(len(table))]
    notes = (*notes, *assumed_units(asked.names, asked.units, table))
    strange = set() if labelled is None else {*labelled.labels} - {*asked.classifier.classes()}
    if strange:
        alike = alike_words(spelled_alike([*strange, *asked.classifier.classes()]))
        names = listed(natural_order(strange))
        told = f"labels that the model does not know, so that no answer to them is right: {names}"
        notes = (*notes, told + (f" (differing in spelling only: {alike})" if alike else ""))
    if len(table) > MOST_WITH_REASONS:
        notes = (*notes, f"more than {MOST_WITH_REASONS} trials: the predictions have no reasons")
    learned = learned_from(asked.learned_from, table.columns(asked.names))
    labels = None if labelled is None else labelled.labels
    rate = None if labelled is None else _rate(predictions, labelled, learned)
    warnings = list(dict.fromkeys(warning for prediction in predictions for warning in prediction.warnings))
    if learned:
        warnings.append(f"{learned}: their predictions say nothing of other trials")
    if echo_values(
        {
            "model": asked.in_a_line,
            "n": len(predictions),
            "predictions": [
                {**prediction.as_json(), **({} if labels is None else {"truth": labels[i]})}
                for i, prediction in enumerate(predictions)
            ],
            "rate": None if rate is None else to_json(rate),
            "unknown": sum(prediction.label == UNKNOWN for prediction in predictions),
            "warnings": warnings,
            "notes": list(notes),
        },
        long=len(predictions) > MOST_WITH_REASONS,
    ):
        return
    _print(predictions, labels)
    echo()
    if rate is not None:
        echo_entry("rate", f"{rate.words}; unknown counts as wrong")
    echo_entry("model", asked.in_a_line)
    echo_entries("warning", warnings, Style.CAUTION)
    echo_entries("note", notes)


def _refuse_swapped(model: str, source: str) -> None:
    """Raise UsageError if the source was named first and the model second."""
    models = {entry.name for entry in installed().resources(ModelEntry)}
    if not model.endswith(".json") and model not in models and (source.endswith(".json") or source in models):
        raise click.UsageError(
            f"{model} is not a model, and {source} is one. The model comes first: graspsense predict {source} {model}"
        )


def _rate(predictions: Sequence[Prediction], labelled: Labelled, learned: str) -> RecognitionRate:
    """Return the rate of these predictions; `learned` says which trials were learned from, and leaves no interval."""
    right = [
        prediction.label == label for prediction, label in zip(predictions, labelled.labels, strict=True)
    ]
    return rate_of(right, labelled.instances, learned or labelled.no_interval)


def _print(predictions: Sequence[Prediction], labels: tuple[str, ...] | None) -> None:
    coverage = next(
        (prediction.coverage for prediction in predictions if prediction.coverage is not None), None
    )
    sets = () if coverage is None else (f"{100 * coverage:.0f} % SET",)
    reasons = Counter(prediction.no_certainty for prediction in predictions if prediction.no_certainty)
    for reason, count in reasons.items():
        trials = "" if count == len(predictions) else f" for {count} of {len(predictions)} trials"
        echo_entry("certainty", f"none{trials}: {reason}")
    header = ("TRIAL", "PREDICTION", "CERTAINTY", *sets, *(("LABEL", "CORRECT") if labels else ()), "BECAUSE")
    rows = []
    for i, prediction in enumerate(predictions):
        of_set = () if coverage is None else (" or ".join(prediction.prediction_set),)
        label = (labels[i], "yes" if prediction.label == labels[i] else "no") if labels else ()
        because = "; ".join(reason.words for reason in prediction.because)
        rows.append((str(i + 1), prediction.label, prediction.certainty_figure, *of_set, *label, because))
    echo_table(header, rows, {"PREDICTION": prediction_style, "CORRECT": state_style})
