"""`graspsense evaluate`: a recognition rate, with everything that is needed to judge it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from graspsense.cli.output import echo_json, file_to_write
from graspsense.cli.sources import SOURCES, classifier_option, learner_of, source_options, trials_of
from graspsense.cli.terminal import echo_table, talk

if TYPE_CHECKING:
    from graspsense.evaluation.results import Evaluation, Measurement


@click.command(
    short_help="Measure the recognition rate by cross-validation.",
    help=f"""Cross-validate a classifier on SOURCE. Print its rate and the controls.

    The headline holds out whole instances if instances are labelled. Otherwise it uses the protocol of the paper:
    ten stratified folds, with pooled predictions. docs/evaluation.md defines every number.

    {SOURCES}""",
)
@click.argument("source")
@click.option(
    "--target",
    type=click.Choice(["both", "class", "state"]),
    default="both",
    show_default=True,
    help="What is recognised: whole labels, classes, or the states within each class.",
)
@click.option("--folds", type=int, default=10, show_default=True, help="Number of folds.")
@click.option("--png", metavar="FILE", callback=file_to_write, help="Draw the confusion matrix.")
@click.option(
    "--keep", metavar="FILE", callback=file_to_write, help="Write the features of all trials as a CSV file."
)
@classifier_option
@source_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def evaluate(
    source: str,
    target: str,
    folds: int,
    png: str | None,
    keep: str | None,
    classifier: str | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Measure and print."""
    from graspsense.cli.progress import ProgressLine
    from graspsense.core.strict import plain
    from graspsense.evaluation.evaluate import evaluate as measure

    learner = learner_of(source, classifier, given)
    with ProgressLine() as progress:
        labelled = trials_of(source, progress, given)
        if keep:
            from graspsense.sources.features_csv import write_labelled

            write_labelled(Path(keep), labelled)
        evaluation = measure(
            learner,
            labelled,
            classifier=f"{learner.component.qualified} {learner.component.version}",
            target=target,  # type: ignore[arg-type]
            folds=folds,
            seed=given["seed"],
            settings={key: value for key, value in plain(learner.config).items() if key != "model"},
            progress=progress,
        )
    if png:
        from graspsense.report.confusion import confusion_png

        title = f"{evaluation.source}\n{evaluation.protocol}: {evaluation.headline.words}"
        confusion_png(evaluation.confusion, title, Path(png))
        talk(f"drawn in {png}")
    if as_json:
        from graspsense.evaluation.json_codec import to_json

        echo_json(to_json(evaluation))
    else:
        _print(evaluation)


def _print(found: Evaluation) -> None:
    from graspsense.report.confusion import confusion_text

    what = {"both": "labels as they are", "class": "classes", "state": "states, each class apart"}[
        found.target
    ]
    click.echo(f"{found.classifier} on {found.source}: {found.headline.n} trials, {what}")
    click.echo(
        f"features: {', '.join(f'{name} [{unit}]' if unit else name for name, unit in found.features)}"
    )
    click.echo(f"\nrate        {found.headline.words}   {found.protocol}")
    for warning in found.warnings:
        click.echo(f"WARNING     {warning}")
    click.echo()
    rows = [_row(name, one) for name, one in found.protocols.items()]
    rows += [_row(name, one) for name, one in found.controls.items() if name not in found.protocols]
    echo_table(("PROTOCOL OR CONTROL", "RATE", "95 %", "LOWER BY", "THAN", "WHAT"), rows)
    click.echo("\nconfusion (rows are the truth)")
    for line in confusion_text(found.confusion):
        click.echo(f"  {line}")
    if len(found.by_class) > 1 and found.target != "class":
        click.echo("\nby class")
        for name, rate in found.by_class.items():
            click.echo(f"  {name:<20}{rate.words}")
    click.echo("\nlearning curve")
    for point in found.learning_curve:
        click.echo(f"  {point.trained_on:8.1f} trials  {point.rate.words}")
    click.echo(f"\nwould be called unknown: {found.unknown.words}")
    for note in found.notes:
        click.echo(f"note: {note}")


def _row(name: str, measured: Measurement) -> tuple[str, ...]:
    if measured.rate is None:
        return name, "-", "", "", "", f"{measured.what}: not measured ({measured.reason})"
    low, high = measured.rate.interval
    difference = measured.difference.words if measured.difference else ""
    return (
        name,
        f"{measured.rate.rate:.3f}",
        f"{low:.3f} to {high:.3f}",
        difference,
        measured.difference_of,
        measured.what,
    )
