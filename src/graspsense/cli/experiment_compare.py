"""`graspsense experiment compare`: several experiments on one page."""

from __future__ import annotations

from pathlib import Path

import click

from graspsense.cli.output import echo_found, echo_json, file_to_write_as
from graspsense.cli.terminal import Style, echo
from graspsense.experiments.comparison import compare_experiments
from graspsense.experiments.comparison_page import comparison_page, comparison_tables, doubts
from graspsense.report.write import write_html

DEFAULT_PAGE = "comparison.html"


@click.command(short_help="Compare the results of several experiments.")
@click.argument("folders", metavar="A B ...", nargs=-1)
@click.option(
    "--out",
    metavar="FILE.html",
    default=DEFAULT_PAGE,
    show_default=True,
    callback=file_to_write_as(".html"),
    help="The page.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the comparison as JSON.")
def compare(folders: tuple[str, ...], out: str, as_json: bool) -> None:
    """Compare experiments: their settings, their rates, and the differences from the first one.

    A, B, ... are folders that `graspsense experiment` wrote. The differences are paired by seed where both experiments
    simulate the same trials with the same seeds.
    """
    comparison = compare_experiments(folders)
    write_html(Path(out), comparison_page(comparison))
    if as_json:
        echo_json({**comparison.as_json(), "page": out})
        return
    echo(comparison.answer, Style.RESULT)
    echo()
    for line in doubts(comparison):
        echo(f"WARNING     {line}", Style.CAUTION, indent=12)
    for table in comparison_tables(comparison):
        echo(table.title, Style.HEADING)
        if table.rows:
            echo_found(table)
        else:
            echo(table.note)
        echo()
    echo(f"page        {out}", indent=12)
