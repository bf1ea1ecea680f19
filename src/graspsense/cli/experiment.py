"""`graspsense experiment`: run or resume an experiment that is described by a file."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from graspsense.cli.options import force_option
from graspsense.cli.output import echo_json
from graspsense.cli.terminal import echo_table, talk

if TYPE_CHECKING:
    from graspsense.experiments.findings import Findings
    from graspsense.experiments.results import Results
    from graspsense.experiments.run import Account
    from graspsense.experiments.summary import Summary

EXIT_INCOMPLETE = 1
EXIT_INTERRUPTED = 130


@click.command(short_help="Run or resume an experiment from a file.")
@click.argument("experiment", required=False, metavar="NAME|FILE")
@click.option("--out", metavar="DIR", help="Folder for the results.  [default: NAME]")
@click.option("--resume", is_flag=True, help="Run only the tasks that have no result in --out yet.")
@click.option(
    "--executor",
    metavar="HOW",
    help="serial, processes, dask, or dask:ADDRESS.  [default: processes; serial on one core]",
)
@click.option("--workers", type=int, help="Number of processes or local workers.  [default: number of cores]")
@click.option(
    "-o",
    "options",
    metavar="KEY=VALUE",
    multiple=True,
    help="Set a key of the file: -o seeds=3, -o data.trials=2. Can be repeated.",
)
@force_option
@click.option("--dry-run", is_flag=True, help="Print what would be done, and do nothing.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def experiment(
    experiment: str | None,
    out: str | None,
    resume: bool,
    executor: str | None,
    workers: int | None,
    options: tuple[str, ...],
    force: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Run the experiment NAME or FILE.toml: every case with every seed. Write report.html to --out.

    Each finished task is stored immediately. After Ctrl-C, a crash or a lost machine, --resume runs only the rest.
    Without NAME, the available experiments are listed. docs/experiments.md describes the file.
    """
    from graspsense.experiments.experiment import read_experiment, shipped

    if experiment is None:
        _list(shipped(), as_json)
        return
    from graspsense.cli.progress import ProgressLine
    from graspsense.experiments.executors.choose import chosen
    from graspsense.experiments.page import findings_of
    from graspsense.experiments.results import Results
    from graspsense.experiments.run import run_experiment
    from graspsense.experiments.summary import summarise

    planned = read_experiment(experiment, options, force=force)
    results = Results(Path(out or planned.name))
    make = chosen(executor, workers)
    if dry_run:
        _plan([task.name for task in planned.tasks()], as_json)
        return
    with ProgressLine() as progress:
        account = run_experiment(
            planned,
            results,
            make,
            resume=resume,
            command=shlex.join(["graspsense", *sys.argv[1:]]),
            progress=progress,
            said=talk,
        )
    found = summarise(planned, results)
    page, problem = _written_page(found, results)
    more = findings_of(found)
    if as_json:
        _print_json(found, more, page, _counts(account, problem))
    else:
        _print(found, more, account, f"none: {problem}" if problem else str(page))
    if account.stopped == "interrupted":
        sys.exit(EXIT_INTERRUPTED)
    if problem or not account.complete:
        sys.exit(EXIT_INCOMPLETE)


def _written_page(found: Summary, results: Results) -> tuple[Path | None, str]:
    """Write the page and return its path, or None and why it could not be written."""
    from graspsense.experiments.page import write_page
    from graspsense.recording.atomic_file import SaveFailed

    try:
        return write_page(found, results), ""
    except SaveFailed as error:
        return None, str(error)


def _counts(account: Account, problem: str) -> dict[str, object]:
    return {
        "tasks": account.total,
        "kept": account.kept,
        "done": account.done,
        "complete": account.complete,
        "stopped": account.stopped or problem or None,
    }


def _list(known: dict[str, object], as_json: bool) -> None:
    from graspsense.experiments.experiment import read_experiment

    rows = [(name, read_experiment(name).experiment.title) for name in known]
    if as_json:
        echo_json([{"name": name, "title": title} for name, title in rows])
    else:
        echo_table(("EXPERIMENT", "WHAT"), rows)


def _plan(names: list[str], as_json: bool) -> None:
    if as_json:
        echo_json(names)
    else:
        click.echo("\n".join(names))
        click.echo(f"{len(names)} tasks")


def _print_json(found: Summary, more: Findings | None, page: Path | None, counts: dict[str, object]) -> None:
    findings = {} if more is None else {"answer": more.answer, "findings": dict(more.values)}
    echo_json({**found.as_json(), **findings, "page": None if page is None else str(page), **counts})


def _print(found: Summary, more: Findings | None, account: Account, page: str) -> None:
    from graspsense.experiments.answer import answer

    click.echo(answer(found) if more is None else more.answer)
    click.echo()
    if more is None:
        _print_rates(found)
    else:
        for one in more.tables:
            click.echo(one.title)
            echo_table(tuple(name.upper() for name in one.header), list(one.rows))
            click.echo()
    for note in account.notes:
        click.echo(f"note: {note}")
    click.echo(account.words)
    reasons: dict[str, int] = {}
    for failure in account.failed:
        reasons[failure.reason] = reasons.get(failure.reason, 0) + 1
    for reason, times in reasons.items():
        click.echo(f"  failed {times} times: {reason}")
    if account.stopped:
        click.echo(f"  stopped: {account.stopped}")
    if not account.complete:
        click.echo("  go on with the same command and --resume: it does what is missing and what failed")
    click.echo(f"page        {page}")


def _print_rates(found: Summary) -> None:
    rows = []
    for one in found.conditions:
        interval = one.rate.interval
        within = "no interval" if interval is None else f"{interval[0]:.3f} to {interval[1]:.3f}"
        rows.append((one.name or "-", one.target, f"{one.rate.mean:.3f}", within, one.protocol))
    if rows:
        echo_table(("CASE", "TARGET", "RATE", "95 %", "PROTOCOL"), rows)
        click.echo()
