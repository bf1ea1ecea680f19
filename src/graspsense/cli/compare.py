"""`graspsense compare`: classifiers and feature sets crossed on the same folds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from graspsense.cli.options import refuse_typed
from graspsense.cli.output import echo_found, echo_values, file_to_write, json_option
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import (
    DEFAULT_CLASSIFIER,
    SOURCES,
    command_line,
    folds_option,
    is_csv,
    learner_of,
    source_argument,
    source_options,
    trials_of,
)
from graspsense.cli.terminal import Style, echo, echo_entries, echo_entry
from graspsense.core.components.entries import Role
from graspsense.core.components.registry import installed
from graspsense.core.values.errors import UnknownName
from graspsense.evaluation.json_codec import to_json
from graspsense.report.write import write_html

if TYPE_CHECKING:
    from graspsense.core.learn.labelled import Labelled
    from graspsense.evaluation.ranking import Ranking

DEFAULT_FEATURES: Final = ("chitta", "columns")
"""The features that are used where none are named: of recordings, and of a table."""


@click.command(
    help=f"""Cross-validate several classifiers with several feature sets on SOURCE, on the same folds.

    Names which are equivalent to the best, and the cheapest of them. Differences are paired by trial, with intervals
    that hold for all pairs together. `before_contact` is the control from before contact (in the iCub data set
    the first frame alone).

    {SOURCES}""",
)
@source_argument
@click.option(
    "--classifiers",
    metavar="NAMES",
    default="c45,svm,forest",
    show_default=True,
    help="Comma-separated classifiers.",
)
@click.option("--feature-sets", metavar="NAMES", help="Comma-separated feature sets; not for a CSV. [chitta]")
@folds_option
@click.option("--out", metavar="FILE.html", callback=file_to_write(".html"), help="Write a page as well.")
@source_options
@json_option()
def compare(
    source: str,
    classifiers: str,
    feature_sets: str | None,
    folds: int,
    out: str | None,
    **given: Any,
) -> None:
    """Measure, print, and write the page."""
    from graspsense.evaluation.ranking import rank

    if feature_sets and is_csv(source):
        raise click.UsageError("--feature-sets is not for a CSV source, which has its features as columns")
    refuse_typed(["target_value"], "is for train, predict and evaluate: compare is for classifiers")
    names = _names(classifiers, "--classifiers", "classifier")
    learners = {name: learner_of(source, name, given) for name in names}
    with ProgressLine() as progress:
        trials = compared_trials(source, feature_sets, folds, progress, given)
        ranking = rank(learners, trials, folds=folds, seed=given["seed"], progress=progress)
    if out is not None:
        from graspsense.report.ranking_page import ranking_page

        write_html(Path(out), ranking_page(ranking, command_line(("out",))))
    page = {} if out is None else {"page": out}
    echo_values({**to_json(ranking), "verdict": ranking.verdict, **page})
    _print(ranking)
    if out is not None:
        echo_entry("page", out)


def compared_trials(
    source: str, feature_sets: str | None, folds: int, progress: ProgressLine, given: Mapping[str, Any]
) -> dict[str, Labelled]:
    """Return the trials of a source with the features of each set, by the name of the set; copies count once.

    `given` holds the options of `source_options`. Raises UsageError, ConfigError, DataDamaged.
    """
    if is_csv(source):
        return {"columns": trials_of(source, progress, given)}
    sets = _names(feature_sets or "chitta", "--feature-sets", "feature-set")
    return {
        name: trials_of(
            source, progress, {**given, "options": (*given["options"], f"features.type={name}")}, folds=folds
        )
        for name in sets
    }


def _print(ranking: Ranking) -> None:
    from graspsense.report.ranking_page import ranking_table

    echo(ranking.verdict, Style.HEADING)
    echo_entry("trials", f"{ranking.trials} of {ranking.source}; compared by {ranking.protocol}")
    echo()
    echo_found(ranking_table(ranking))
    echo_entries("note", ranking.notes)
    for candidate in ranking.candidates:
        is_default = candidate.classifier == DEFAULT_CLASSIFIER and candidate.features in DEFAULT_FEATURES
        if is_default and candidate.standing == "worse":
            echo_entry(
                "advice",
                f"the default, {candidate.name}, is worse on these trials: train --choose finds what suits them",
            )


def _names(text: str, option: str, role: Role) -> tuple[str, ...]:
    """Return the names of components of a role that an option lists. Raises UsageError for an unknown one."""
    names: dict[str, str] = {}
    for name in filter(None, map(str.strip, text.split(","))):
        try:
            component = installed().find(role, name).qualified
        except UnknownName as unknown:
            raise click.UsageError(f"{option} {name}: {unknown}") from None
        if component in names:
            raise click.UsageError(
                f"{option}: {names[component]} and {name} are the same, {component}: name each once"
            )
        names[component] = name
    if not names:
        raise click.UsageError(f"{option} names nothing: give names with commas between them")
    return tuple(names.values())
