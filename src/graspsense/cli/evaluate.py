"""`graspsense evaluate`: a recognition rate, with everything that is needed to judge it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from graspsense.cli.events import evaluate_events
from graspsense.cli.options import refuse_typed, target_option, time_range
from graspsense.cli.output import check_outputs, echo_values, file_to_write, json_option, page_to_write
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import (
    SOURCES,
    checkpoints_option,
    classifier_option,
    command_line,
    folds_option,
    keep_features,
    keep_option,
    learner_of,
    source_argument,
    source_options,
    trials_of,
)
from graspsense.cli.target_value import evaluate_value
from graspsense.cli.terminal import Style, echo, echo_entries, echo_entry, echo_table, talk
from graspsense.core.components.strict import plain
from graspsense.core.values.errors import ConfigError
from graspsense.evaluation.intervals import percent, percentages
from graspsense.evaluation.json_codec import to_json
from graspsense.report.confusion import confusion_png, confusion_text
from graspsense.report.write import write_html

if TYPE_CHECKING:
    from graspsense.core.learn.checkpoints import CheckpointTrials
    from graspsense.core.learn.labelled import Labelled
    from graspsense.evaluation.checkpoints import EarlyRecognition
    from graspsense.evaluation.results import Evaluation, Measurement


@click.command(
    help=f"""Cross-validate a classifier on SOURCE. Print its rate and the controls.

    The headline holds out whole instances if instances are labelled. Otherwise it uses the protocol of the paper:
    ten stratified folds, with pooled predictions. docs/evaluation.md defines every number.

    {SOURCES}""",
)
@source_argument
@target_option("What is recognised: whole labels, classes, or the states within each class.")
@folds_option
@click.option("--png", metavar="FILE.png", callback=file_to_write(".png"), help="Draw the confusion matrix.")
@click.option("--report", metavar="DIR", help="Write the page DIR/report.html as well.")
@keep_option
@click.option("--overwrite", is_flag=True, help="Replace the file of --keep if it exists.")
@checkpoints_option
@click.option(
    "--events",
    is_flag=True,
    help="Score the events that a controller reports against labelled ones: contact, slip, placing.",
)
@click.option(
    "--tolerance",
    type=time_range(60.0),
    default=0.25,
    show_default=True,
    metavar="SECONDS",
    help="--events: longest time from the beginning of an event to its detection, before or after.",
)
@classifier_option
@source_options
@json_option()
def evaluate(
    source: str,
    target: str,
    folds: int,
    png: str | None,
    report: str | None,
    keep: str | None,
    overwrite: bool,
    checkpoints: str | None,
    classifier: str | None,
    **given: Any,
) -> None:
    """Measure and print."""
    if given["events"]:
        evaluate_events(source, given["tolerance"], folds, given)
        return
    refuse_typed(["tolerance"], "is for --events")
    from graspsense.core.learn.checkpoints import checkpoints_of
    from graspsense.evaluation.checkpoints import early_recognition
    from graspsense.evaluation.evaluate import evaluate as measure
    from graspsense.report.evaluation_page import evaluation_page

    check_outputs(keep, overwrite=overwrite, sources=[source])
    if given["target_value"]:
        evaluate_value(source, classifier, folds, keep, given)
        return
    page = None if report is None else page_to_write(report)
    times = checkpoints_of(checkpoints)
    learner = learner_of(source, classifier, given)
    with ProgressLine() as progress:
        labelled = trials_of(source, progress, given, times, folds)
        labelled, parts = _parts(labelled, times, target)
        keep_features(keep, labelled)
        evaluation = measure(
            learner,
            labelled,
            target=target,  # type: ignore[arg-type]
            folds=folds,
            seed=given["seed"],
            settings={key: value for key, value in plain(learner.config).items() if key != "model"},
            progress=progress,
        )
        early = early_recognition(learner, parts, folds=folds, seed=given["seed"]) if parts else None
    if png:
        title = f"{evaluation.source}\n{evaluation.protocol}: {evaluation.headline.words}"
        confusion_png(evaluation.confusion, title, Path(png))
        talk(f"drawn in {png}")
    if page is not None:
        command = command_line(("report", "png", "keep", "overwrite"))
        write_html(page, evaluation_page(evaluation, learner, labelled, command))
    more = {} if early is None else {"early": to_json(early)}
    more |= {} if page is None else {"page": str(page)}
    echo_values({**to_json(evaluation), **more})
    _print(evaluation)
    if early is not None:
        _print_early(early)
    if page is not None:
        echo_entry("page", str(page))


def _parts(
    labelled: Labelled, times: Sequence[float], target: str
) -> tuple[Labelled, tuple[CheckpointTrials, ...]]:
    """Return the trials, and the parts of them up to each checkpoint with the labels of the target."""
    from graspsense.core.learn.checkpoints import split_checkpoints

    if not times:
        return labelled, ()
    if target == "state":
        raise ConfigError(
            "--checkpoints goes with --target both or class: recognise one class with --only CLASS"
        )
    return (
        split_checkpoints(labelled, times)[-1].labelled,
        split_checkpoints(labelled.aimed(target), times),
    )


def _print_early(recognition: EarlyRecognition) -> None:
    from graspsense.evaluation.checkpoints import SURE

    echo(f"\nanswers during the grasp, by {recognition.protocol}")
    if recognition.reason:
        echo(f"no prediction sets: {recognition.reason}", indent=2)
    rows = []
    for row in recognition.rows:
        told = [
            "-" if share is None else percent(share.rate) if share.n else "-"
            for share in (row.covered, row.single)
        ]
        newtons = "-" if row.newtons is None else f"{row.newtons:.2f} N"
        costs = (f"{row.seconds:.3f} s", newtons)
        rows.append((row.name, percent(row.rate.rate), percentages(row.rate.interval), *costs, *told))
    heads = ("ANSWER AFTER", "RATE", "95 %", "TIME", "FORCE", "TRUE LABEL IN SET", "SETS OF ONE")
    echo_table(heads, rows)
    if recognition.rows[-1].name == SURE:
        echo(
            f"{SURE}: the last two are the rate among the grasps that were ended early, and their share",
            indent=2,
        )


def _print(evaluation: Evaluation) -> None:
    from graspsense.report.verdict import verdict

    echo(verdict(evaluation), Style.HEADING)
    echo_entries("WARNING", evaluation.warnings, Style.CAUTION)
    echo()
    echo_entry("rate", f"{evaluation.headline.words}, by {evaluation.protocol}")
    for name, part in evaluation.by_features.items():
        echo_entry("", f"{percent(part.rate)} ({part.correct} of {part.n}) {name}")
    echo_entry("classifier", evaluation.classifier)
    echo_entry("features", ", ".join(name for name, _ in evaluation.features))
    echo_entry(
        "unknown",
        f"{evaluation.unknown.words} would be called unknown (false alarms: their labels are known); "
        "by a model that is trained on all trials, as many or fewer",
    )
    _print_doubt(evaluation)
    echo_entries("note", evaluation.notes)
    echo()
    # What is both counts as a protocol; these come first.
    measurements = {**evaluation.protocols, **evaluation.controls, **evaluation.protocols}
    _print_measurements(measurements, evaluation.headline.n)
    for name, measurement in measurements.items():
        if measurement.rate is None:
            echo(f"{name}: not measured ({measurement.reason})", indent=2)
    echo("\nconfusion (rows are the truth)")
    for line in confusion_text(evaluation.confusion):
        echo(f"  {line}")
    if len(evaluation.by_class) > 1 and evaluation.target != "class":
        echo()
        rows = [(name, percent(rate.rate), percentages(rate.interval), f"{rate.correct} of {rate.n}")
                for name, rate in evaluation.by_class.items()]  # fmt: skip
        echo_table(("CLASS", "RATE", "95 %", "TRIALS"), rows)
    if evaluation.reliability is not None:
        echo("\nreliability of the probabilities")
        bins = [(percent(bin_.probability), percent(bin_.rate.rate), percentages(bin_.rate.interval),
                 str(bin_.rate.n)) for bin_ in evaluation.reliability.curve]  # fmt: skip
        echo_table(("MEAN PROBABILITY", "RATE", "95 %", "TRIALS"), bins)
    if evaluation.learning_curve:
        echo("\nlearning curve")
        points = [(f"{point.trained_on:.0f}", percent(point.rate.rate), percentages(point.rate.interval))
                  for point in evaluation.learning_curve]  # fmt: skip
        echo_table(("TRAINING TRIALS", "RATE", "95 %"), points)


def _print_doubt(evaluation: Evaluation) -> None:
    sets = evaluation.sets
    if sets is not None and (sets.covered is None or sets.single is None):
        echo_entry("sets", f"not measured ({sets.reason})")
    elif sets is not None and sets.covered is not None and sets.single is not None:
        echo_entry(
            "sets",
            f"{sets.covered.words} contain the true label; {100 * sets.asked:.0f} % asked for, by {sets.unit}",
        )
        if sets.covered_below is not None:
            echo_entry(
                "", f"{sets.covered_below.words} of the trials whose label is recognised less often than that"
            )
        least = min(sets.by_label, key=lambda name: sets.by_label[name].rate)
        echo_entry("", f"{sets.mean_size:.2f} labels on average, {percent(sets.single.rate)} of the sets have one; "
                       f"lowest coverage: {percent(sets.by_label[least].rate)} of {least}")  # fmt: skip
    if evaluation.reliability is not None:
        error = percent(evaluation.reliability.calibration_error)
        raw = evaluation.reliability.uncalibrated_error
        raw_words = "" if raw is None else f" ({percent(raw)} before calibration)"
        echo_entry(
            "probability",
            f"Brier score {evaluation.reliability.brier:.3f}, expected calibration error {error}{raw_words}",
        )


def _print_measurements(measurements: Mapping[str, Measurement], trials: int) -> None:
    rows = []
    for name, measured in measurements.items():
        if (rate := measured.rate) is None:
            continue
        lower_by = "" if measured.difference is None else measured.difference.points
        compared = f" (compared with {measured.difference_of})" if measured.difference_of else ""
        cells = (name, percent(rate.rate), percentages(rate.interval), f"{rate.n} of {trials}")
        rows.append((*cells, lower_by, measured.what + compared))
    echo_table(("PROTOCOL OR CONTROL", "RATE", "95 %", "TRIALS", "LOWER BY, IN POINTS", "WHAT"), rows)
