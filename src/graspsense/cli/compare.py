"""`graspsense compare`: classifiers and feature sets crossed on the same folds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from graspsense.cli.output import echo_json
from graspsense.cli.sources import SOURCES, is_csv, learner_of, source_options, trials_of
from graspsense.cli.terminal import Style, echo, echo_entry, echo_table

if TYPE_CHECKING:
    from graspsense.evaluation.ranking import Ranking


@click.command(
    short_help="Compare classifiers and feature sets on the same folds.",
    help=f"""Cross-validate several classifiers with several feature sets on SOURCE, on the same folds.

    Names which are equivalent to the best, and the cheapest of them. Differences are paired by trial, with intervals
    corrected for the number of comparisons. `before_contact` is the control from before contact (in the iCub data set
    the first frame alone).

    {SOURCES}""",
)
@click.argument("source")
@click.option(
    "--classifiers",
    metavar="NAMES",
    default="c45,svm,forest",
    show_default=True,
    help="Comma-separated classifiers.",
)
@click.option("--feature-sets", metavar="NAMES", help="Comma-separated feature sets; not for a CSV. [chitta]")
@click.option("--folds", type=int, default=10, show_default=True, help="Number of folds.")
@source_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def compare(
    source: str, classifiers: str, feature_sets: str | None, folds: int, as_json: bool, **given: Any
) -> None:
    """Measure and print."""
    from graspsense.cli.progress import ProgressLine
    from graspsense.evaluation.json_codec import to_json
    from graspsense.evaluation.ranking import rank

    if feature_sets and is_csv(source):
        raise click.UsageError("--feature-sets is not for a CSV source, which has its features as columns")
    if given["target_value"]:
        raise click.UsageError(
            "compare is for classifiers; --target-value is for train, predict and evaluate"
        )
    names = _names(classifiers, "--classifiers")
    learners = {name: learner_of(source, name, given) for name in names}
    with ProgressLine() as progress:
        if is_csv(source):
            trials = {"columns": trials_of(source, progress, given)}
        else:
            trials = {
                name: trials_of(
                    source, progress, {**given, "options": (*given["options"], f"features.type={name}")}
                )
                for name in _names(feature_sets or "chitta", "--feature-sets")
            }
        found = rank(learners, trials, folds=folds, seed=given["seed"], progress=progress)
    if as_json:
        echo_json({**to_json(found), "verdict": found.verdict})
    else:
        _print(found)


def _print(found: Ranking) -> None:
    from graspsense.evaluation.intervals import percentage

    echo(found.verdict, Style.HEADING)
    echo_entry("trials", f"{found.trials} of {found.source}; compared by {found.protocol}")
    echo()
    protocols = list(dict.fromkeys(name for one in found.candidates for name in one.rates))
    rows = [
        (
            one.classifier,
            one.features,
            *(percentage(one.rates[name].rate) if name in one.rates else "" for name in protocols),
            "" if one.loss is None else one.loss.points,
            one.standing,
            f"{one.training_s:.2g} s",
        )
        for one in found.candidates
    ]
    headings = [name.replace("_", " ").upper() for name in protocols]
    echo_table(("CLASSIFIER", "FEATURES", *headings, "LOSS, IN POINTS", "STANDING", "TRAINING"), rows)
    for note in found.notes:
        echo_entry("note", note)


def _names(text: str, option: str) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(one.strip() for one in text.split(",") if one.strip()))
    if not names:
        raise click.UsageError(f"{option} names nothing: give names with commas between them")
    return names
