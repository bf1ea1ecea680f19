"""`graspsense report`: the page of a store, or that of an experiment once more."""

from __future__ import annotations

from pathlib import Path

import click
from attrs import evolve

from graspsense.cli.options import SEED, target_option
from graspsense.cli.output import echo_values, json_option, page_to_write
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import folds_option, named_store
from graspsense.cli.terminal import Style, echo, echo_as_it_is, warn
from graspsense.report.write import write_html


@click.command()
@click.argument("folder", metavar="DIR", callback=named_store)
@click.option("--out", metavar="DIR", help="Folder for report.html.  [default: DIR]")
@click.option(
    "--classifier", metavar="NAME", default="c45", show_default=True, help="Store: classifier to evaluate."
)
@target_option("Store: what is recognised, as in `evaluate`.")
@folds_option
@click.option("--seed", type=SEED, default=0, show_default=True, help="Store: seed of the folds.")
@click.option(
    "--grasp", type=int, metavar="NUMBER", help="Store: trial to plot over time.  [default: the newest]"
)
@click.option(
    "--target-value",
    "values",
    metavar="NAME",
    multiple=True,
    help="Store: a number to predict, which gets a section. Can be repeated.",
)
@json_option("Print the path of the page as JSON.")
def report(
    folder: str,
    out: str | None,
    classifier: str,
    target: str,
    folds: int,
    seed: int,
    grasp: int | None,
    values: tuple[str, ...],
) -> None:
    """Write report.html for the store or the experiment in DIR.

    The page is one file without external resources.
    """
    from graspsense.experiments.page import NAME, experiment_page
    from graspsense.experiments.results import EXPERIMENT, Results
    from graspsense.report.number_section import number_sections
    from graspsense.report.store_page import store_page

    path = Path(folder) / NAME if out is None or Path(out) == Path(folder) else page_to_write(out)
    if (Path(folder) / EXPERIMENT).is_file():
        from graspsense.experiments.summary import summary_of

        if values:
            raise click.UsageError("--target-value is for the page of a store; this folder has an experiment")
        results = Results(Path(folder))
        summary = summary_of(results)
        for line in (*summary.left_out, *summary.doubts):
            warn(line)
        page = experiment_page(summary, results)
    else:
        with ProgressLine() as progress:
            numbers = number_sections(folder, values, folds, seed, progress)
            page = store_page(
                folder,
                classifier=classifier,
                target=target,  # type: ignore[arg-type]
                folds=folds,
                seed=seed,
                grasp=grasp,
                progress=progress,
            )
        page = evolve(page, sections=(*numbers, *page.sections))
    write_html(path, page)
    echo_values({"page": str(path), "answer": page.answer})
    echo(page.answer, Style.HEADING)
    echo_as_it_is(f"page        {path}")
