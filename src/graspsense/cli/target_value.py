"""`evaluate`, `train` and `predict` with --target-value: a number in place of a label."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from attrs import evolve

from graspsense.cli.options import refuse_typed
from graspsense.cli.output import echo_found, echo_values
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import command_line, keep_features, to_predict, trials_of
from graspsense.cli.terminal import Style, echo, echo_as_it_is, echo_entries, echo_entry, echo_table, talk
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import assumed_units
from graspsense.core.values.units import with_unit
from graspsense.evaluation.gathered_warnings import gathered_warnings
from graspsense.evaluation.json_codec import to_json
from graspsense.regression.results import RegressionEvaluation, error_of

if TYPE_CHECKING:
    from graspsense.regression.model import PredictedValue, RegressionModel

_FOR_LABELS: Final = ("png", "report", "target", "checkpoints")


def _estimator(named: str | None, options: Sequence[str]) -> str:
    """Return the estimator that is named, or the default one, before any trial is read.

    Raises UsageError for options that mean nothing for a number, ConfigError for an unknown estimator.
    """
    from graspsense.regression.estimators import DEFAULT_ESTIMATOR, check_estimator

    refuse_typed(_FOR_LABELS, "is for labels, and --target-value names a number")
    for option in options:
        if option.partition(".")[0].strip() == "classifier":
            raise click.UsageError(
                f"-o {option}: the estimators of numbers have no settings; select one with --classifier",
                click.get_current_context(),
            )
    if named is None:
        return DEFAULT_ESTIMATOR
    check_estimator(named)
    return named


def evaluate_value(
    source: str, estimator: str | None, folds: int, keep: str | None, given: Mapping[str, Any]
) -> None:
    """Cross-validate the prediction of a number, and print it."""
    from graspsense.regression.evaluate import evaluate_regression

    chosen = _estimator(estimator, given["options"])
    with ProgressLine() as progress:
        labelled = trials_of(source, progress, given)
        keep_features(keep, labelled)
        evaluation = evaluate_regression(chosen, labelled, folds=folds, seed=given["seed"], progress=progress)
    echo_values(to_json(evaluation))
    _print_evaluation(evaluation)


def train_value(
    source: str, estimator: str | None, out: str, keep: str | None, given: Mapping[str, Any]
) -> None:
    """Train a model of a number, write it, and print what it was trained on."""
    from graspsense.core.learn.conformal import COVERAGE
    from graspsense.regression.model import train_regression, write_regression

    chosen = _estimator(estimator, given["options"])
    with ProgressLine() as progress:
        labelled = trials_of(source, progress, given)
    notes = list(labelled.notes)
    with gathered_warnings(notes):
        model = train_regression(
            chosen,
            labelled,
            name=Path(out).stem,
            seed=given["seed"],
            provenance={"command": command_line(("keep", "overwrite"))},
        )
    write_regression(Path(out), model)
    keep_features(keep, labelled)
    for note in notes:
        talk(f"note: {note}")
    content = model.as_json()
    kept = ("estimator", "target_value", "features", "provenance", "interval")
    echo_values({"model": out, **{key: content[key] for key in kept}, "trials": len(labelled)})
    echo(f"{out}: {model.in_a_line}", indent=2)
    unit = model.target.unit
    widths = model.intervals.half_widths
    least, most = (with_unit(f"{end(widths):.4g}", unit) if widths else "" for end in (min, max))
    echo_entry(
        "interval",
        f"none: {model.intervals.reason}"
        if not widths
        else f"{100 * COVERAGE:.0f} %, prediction plus or minus {least}"
        + ("" if most == least else f" to {most}, by its size"),
    )
    # In one line, so that it can be copied.
    echo_as_it_is(f"how good    {command_line(('out', 'keep', 'overwrite'), 'evaluate')}")
    echo_as_it_is(f"use it      graspsense predict {shlex.quote(out)} OTHER")


def predict_value(model_name: str, source: str, given: Mapping[str, Any]) -> None:
    """Predict a number for each trial, and compare it with the true one if --target-value names it."""
    from graspsense.core.learn.copies import learned_from, row_hashes
    from graspsense.regression.model import load_regression

    model = load_regression(model_name)
    table, labelled, notes = to_predict(source, model.table.names, given)
    value = None if labelled is None else labelled.value
    if value is not None and model.target.unit and value.unit and model.target.unit != value.unit:
        raise ConfigError(
            f"model {model.name!r} predicts {model.target.name} in {model.target.unit}; {value.name} of {source} is "
            f"in {value.unit}"
        )
    provenance = None if labelled is None else labelled.provenance
    predictions = model.predict(table, provenance)
    notes = (*notes, *assumed_units(model.table.names, model.table.units, table))
    warnings, error, truth = [*model.warnings, *model.differences(provenance)], None, None
    learned = learned_from(row_hashes(model.table), table.columns(model.table.names))
    if learned:
        warnings.append(f"{learned}: their predictions say nothing of other trials")
    if labelled is not None and value is not None:
        truth = value.values
        errors = [prediction.value - true for prediction, true in zip(predictions, truth, strict=True)]
        error = error_of(errors, labelled.instances)
        if learned:
            error = evolve(error, interval=None, no_interval=learned)
    echo_values(
        {
            "model": model.in_a_line,
            "target_value": model.target.name,
            "unit": model.target.unit,
            "n": len(predictions),
            "predictions": [
                {
                    "value": prediction.value,
                    "interval": None if prediction.low is None else [prediction.low, prediction.high],
                    "no_interval": prediction.no_interval,
                    "unlike": prediction.unlike,
                    **({} if truth is None else {"truth": truth[i]}),
                }
                for i, prediction in enumerate(predictions)
            ],
            "error": None if error is None else to_json(error),
            "warnings": warnings,
            "notes": list(notes),
        }
    )
    _print_predictions(model, predictions, truth)
    echo()
    if error is not None:
        echo_entry("error", f"{error.words(model.target.unit)} on average, in absolute value")
    echo_entry("model", model.in_a_line)
    echo_entries("warning", warnings, Style.CAUTION)
    echo_entries("note", notes)


def _print_predictions(
    model: RegressionModel, predictions: Sequence[PredictedValue], truth: Sequence[float] | None
) -> None:
    unit = f" [{model.target.unit}]" if model.target.unit else ""
    header = ("TRIAL", f"PREDICTION{unit}", "90 % INTERVAL", *(("TRUE", "ERROR") if truth else ()), "NOTE")
    rows = []
    for i, prediction in enumerate(predictions):
        interval = "" if prediction.low is None else f"{prediction.low:.4g} to {prediction.high:.4g}"
        true = () if truth is None else (f"{truth[i]:.4g}", f"{prediction.value - truth[i]:+.3g}")
        rows.append((str(i + 1), f"{prediction.value:.4g}", interval, *true, prediction.no_interval))
    echo_table(header, rows)


def _print_evaluation(evaluation: RegressionEvaluation) -> None:
    from graspsense.report.number_section import not_measured, number_table, number_verdict

    echo(number_verdict(evaluation), Style.HEADING)
    echo_entries("WARNING", evaluation.warnings, Style.CAUTION)
    echo()
    echo_entry("error", f"{evaluation.headline.words(evaluation.unit)}, by {evaluation.protocol}")
    root = with_unit(f"{evaluation.headline.root_mean_square:.4g}", evaluation.unit)
    echo_entry("", f"root of the mean squared error {root}")
    if evaluation.explained is not None:
        echo_entry("R2", f"{evaluation.explained:.2f} (1 is perfect, 0 is no better than the mean)")
    intervals = evaluation.intervals
    if intervals.covered is None or intervals.mean_half_width is None:
        echo_entry("intervals", f"not measured ({intervals.reason})")
    else:
        half_width = with_unit(f"{intervals.mean_half_width:.4g}", evaluation.unit)
        echo_entry(
            "intervals",
            f"{intervals.covered.words} contain the true number; {100 * intervals.asked:.0f} % asked for, by "
            f"{intervals.unit}; plus or minus {half_width} on average",
        )
    echo_entry("features", ", ".join(name for name, _ in evaluation.features))
    echo_entries("note", evaluation.notes)
    echo()
    echo_found(number_table(evaluation))
    for sentence in not_measured(evaluation):
        echo(sentence, indent=2)
