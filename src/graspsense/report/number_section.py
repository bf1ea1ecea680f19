"""The section of a page about a number that is predicted for each trial, such as a fill level."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from graspsense.core.learn.copies import without_copies
from graspsense.core.values.errors import counted
from graspsense.core.values.units import with_unit
from graspsense.regression.estimators import DEFAULT_ESTIMATOR
from graspsense.regression.evaluate import evaluate_regression
from graspsense.regression.results import RegressionError, RegressionEvaluation, RegressionMeasurement
from graspsense.report.found_table import FoundTable
from graspsense.report.html import Section, bullets, figure, pair, paragraph, table
from graspsense.report.svg import INKS, QUIET, Picture, number, reaching
from graspsense.store.dataset import labelled_store


def number_sections(
    folder: str,
    names: Sequence[str],
    folds: int,
    seed: int,
    progress: Callable[[str, int, int], None] | None = None,
) -> list[Section]:
    """Return a section for each of these numbers of the trials of a store.

    Raises ConfigError if no trial has such a number, or if there are too few trials; DataDamaged.
    """
    return [
        number_section(
            evaluate_regression(
                DEFAULT_ESTIMATOR,
                without_copies(labelled_store(folder, value=name)),
                folds=folds,
                seed=seed,
                progress=progress,
            )
        )
        for name in dict.fromkeys(names)
    ]


def number_verdict(evaluation: RegressionEvaluation) -> str:
    """Return the error with which the number is predicted, and on which objects, in a sentence."""
    unseen = evaluation.protocol == "instance_held_out"
    grasps = "no grasp was used" if unseen else "other grasps may have been used"
    trials = counted(evaluation.headline.n, "trial")
    return (
        f"{evaluation.estimator} predicts {evaluation.target_value} of {trials} of {evaluation.source} with a mean "
        f"absolute error of {evaluation.headline.words(evaluation.unit)}, on instances of which {grasps} for training."
    )


def number_table(evaluation: RegressionEvaluation) -> FoundTable:
    """Return the errors of the protocols and controls that were measured."""
    measured = {**evaluation.protocols, **evaluation.controls}
    return FoundTable(
        id="errors",
        title=f"Errors of {evaluation.target_value}: other protocols, and controls",
        header=(
            "protocol or control",
            with_unit("error", evaluation.unit and f"[{evaluation.unit}]"),
            "95 %",
            "trials",
            "larger by",
            "what",
        ),
        rows=tuple(
            _cells(name, measurement.error, measurement, evaluation.headline.n)
            for name, measurement in measured.items()
            if measurement.error is not None
        ),
        numbers=1,
    )


def not_measured(evaluation: RegressionEvaluation) -> list[str]:
    """Return a sentence for each protocol or control that could not be measured."""
    measured = {**evaluation.protocols, **evaluation.controls}
    return [f"{name}: not measured ({each.reason})" for name, each in measured.items() if each.error is None]


def _cells(
    name: str, error: RegressionError, measurement: RegressionMeasurement, trials: int
) -> tuple[str, ...]:
    larger = ""
    if measurement.difference is not None:
        larger = f"{measurement.difference.value:+.3g}"
        if measurement.difference.interval is not None:
            low, high = measurement.difference.interval
            larger += f" ({low:+.3g} to {high:+.3g})"
    compared = f" (compared with {measurement.difference_of})" if measurement.difference_of else ""
    return (
        name,
        f"{error.mean_absolute:.4g}",
        "no interval" if error.interval is None else f"{error.interval[0]:.4g} to {error.interval[1]:.4g}",
        f"{error.n} of {trials}",
        larger,
        f"{measurement.what}{compared}",
    )


def number_section(evaluation: RegressionEvaluation) -> Section:
    """Return the section with the error of a predicted number, its controls, and each prediction beside the truth."""
    name, unit = evaluation.target_value, evaluation.unit
    text = number_verdict(evaluation)
    if evaluation.explained is not None:
        text += (
            f" R² is {evaluation.explained:.2f}: 1 is perfect, 0 no better than always predicting the mean."
        )
    intervals = evaluation.intervals
    if intervals.covered is None or intervals.mean_half_width is None:
        text += f" Prediction intervals are not measured: {intervals.reason}."
    else:
        text += (
            f" Prediction intervals of {100 * intervals.asked:.0f} % contain the true number in "
            f"{intervals.covered.words}; they are plus or minus "
            f"{with_unit(number(intervals.mean_half_width), unit)} on average."
        )
    errors = number_table(evaluation)
    rows = [(name.replace("_", " "), *cells) for name, *cells in errors.rows]
    body = (
        paragraph(text)
        + bullets(evaluation.warnings, "warning")
        + pair(
            _scatter(evaluation),
            table(errors.title, errors.header, rows, errors.numbers) + bullets(not_measured(evaluation)),
        )
    )
    identifier = re.sub("[^a-z0-9]", "-", name.lower())
    return Section(id=f"number-{identifier}", title=f"Predicted number: {name}", body=body)


def _scatter(evaluation: RegressionEvaluation) -> str:
    """Return each prediction over the true number, beside the line on which they are equal."""
    values = [value for pair_ in evaluation.predictions for value in pair_]
    picture = Picture(330)
    x, y = reaching(values, 50.0, picture.width - 16), reaching(values, 280.0, 24.0)
    unit = evaluation.unit and f"in {evaluation.unit}"
    with picture.axes(x, y, with_unit(f"true {evaluation.target_value}", unit), with_unit("predicted", unit)):
        picture.line([(x(end), y(end)) for end in (x.low, x.high)], QUIET)
        for truth, predicted in evaluation.predictions:
            words = f"{number(truth)}, predicted {number(predicted)}"
            picture.mark(x(truth), y(predicted), INKS[0], words=words)
    caption = "Each mark is a grasp that was held out from training. The line is where both are equal."
    return figure(picture.svg(f"Predicted and true {evaluation.target_value}. {caption}"), caption)
