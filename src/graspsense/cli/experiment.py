"""`graspsense experiment`: run or resume an experiment that is described by a file, and compare several."""

from __future__ import annotations

import os
import shlex
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from attrs import asdict

from graspsense.cli.live import Live, LiveOptions, live_options, shown_live
from graspsense.cli.options import force_option, keys_option
from graspsense.cli.output import echo_found, echo_values, file_to_write, json_option
from graspsense.cli.progress import ProgressLine
from graspsense.cli.terminal import Style, echo, echo_entries, echo_entry, echo_rows, echo_table, talk
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.errors import ExitCode, counted
from graspsense.evaluation.intervals import percent, percentages
from graspsense.report.write import write_html

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from graspsense.experiments.duration import Effort
    from graspsense.experiments.executors.executor import Executor
    from graspsense.experiments.experiment import Planned
    from graspsense.experiments.findings import Findings
    from graspsense.experiments.results import Results
    from graspsense.experiments.run import Account
    from graspsense.experiments.summary import ConditionResult, Summary
    from graspsense.report.found_table import FoundTable

_MOST_NAMED = 8


class ExperimentCommand(click.Command):
    """The command `experiment`, and as `experiment compare` the command that compares experiments."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        """Return the context of this command, or of the comparison if that is asked for."""
        if args[:1] == ["compare"]:
            return compare.make_context(f"{info_name} compare", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)


@click.command(cls=ExperimentCommand)
@click.argument("experiment", required=False, metavar="NAME|FILE")
@click.option("--out", metavar="DIR", help="Folder for the results.  [default: NAME]")
@click.option("--resume", is_flag=True, help="Run only the tasks that have no result in --out yet.")
@click.option(
    "--executor",
    metavar="HOW",
    help="serial, processes, or dask:ADDRESS.  [default: processes; serial on one core]",
)
@click.option("--workers", type=int, help="Number of processes.  [default: number of cores]")
@keys_option("Set a key of the file: -o seeds=3, -o data.trials=2.", "KEY=VALUE")
@force_option
@live_options
@click.option("--dry-run", is_flag=True, help="Print what would be done, and do nothing.")
@json_option()
def experiment(
    experiment: str | None,
    out: str | None,
    resume: bool,
    executor: str | None,
    workers: int | None,
    options: tuple[str, ...],
    force: bool,
    live: bool,
    live_address: str | None,
    dry_run: bool,
) -> None:
    """Run the experiment NAME or FILE.toml: every case with every seed. Write report.html to --out.

    Each finished task is stored immediately. After Ctrl-C, a crash or a lost machine, --resume runs only the rest.
    Without NAME, the available experiments are listed. docs/experiments.md describes the file.

    `graspsense experiment compare A B ...` compares the results of several experiments.
    """
    from graspsense.experiments.experiment_file import read_experiment, shipped

    if experiment is None:
        _list(shipped())
        return
    from graspsense.experiments.answer import answer
    from graspsense.experiments.executors.choose import chosen
    from graspsense.experiments.page import findings_of, write_page
    from graspsense.experiments.results import Results
    from graspsense.experiments.run import refuse_store
    from graspsense.experiments.summary import summarise

    planned = read_experiment(experiment, options, force=force)
    results = Results(Path(out or planned.name))
    make = chosen(executor, workers)
    refuse_store(results.folder)
    if dry_run:
        _plan(planned, results, workers or os.cpu_count() or 1)
        return
    with shown_live(LiveOptions(live, live_address)) as shown:
        account = _run(planned, results, make, resume, shown)
        summary = summarise(planned, results)
        page, problem = None, ""
        try:
            page = str(write_page(summary, results))
        except SaveFailed as error:
            problem = str(error)
        more = findings_of(summary)
        shown.told("progress", {"text": answer(summary) if more is None else more.answer})
    findings = {} if more is None else {"answer": more.answer, "findings": dict(more.values)}
    echo_values({**summary.as_json(), **findings, "page": page, **_counts(account, problem)})
    _print(summary, more, account, page or f"none: {problem}")
    if account.stopped == "interrupted":
        raise click.exceptions.Exit(ExitCode.INTERRUPTED)
    if problem or not account.complete:
        raise click.exceptions.Exit(ExitCode.CHECK_FAILED)


def _run(
    planned: Planned, results: Results, make: Callable[[], Executor], resume: bool, shown: Live
) -> Account:
    """Run the tasks, and show how many are done."""
    from graspsense.experiments.run import run_experiment

    with ProgressLine() as line:

        def progress(what: str, done: int, total: int) -> None:
            line(what, done, total)
            shown.told("progress", {"text": f"{what}: {done} of {total}"})

        return run_experiment(
            planned,
            results,
            make,
            resume=resume,
            command=shlex.join(["graspsense", *sys.argv[1:]]),
            progress=progress,
            said=talk,
        )


def _counts(account: Account, problem: str) -> dict[str, object]:
    return {
        "tasks": account.total,
        "kept": account.kept,
        "done": account.done,
        "complete": account.complete,
        "stopped": account.stopped or problem or None,
        "changed": list(account.notes),
    }


def _list(known: Iterable[str]) -> None:
    from graspsense.experiments.duration import ESTIMATED_FROM, effort_of
    from graspsense.experiments.experiment_file import read_plan

    cores = os.cpu_count() or 1
    plans = [(name, read_plan(name)) for name in known]
    listed = [(name, plan.experiment.title, effort_of(plan)) for name, plan in plans]
    echo_values([{"name": name, "title": title, **_effort_as_json(effort)} for name, title, effort in listed])
    rows = [(name, effort.time_on(cores), str(effort.tasks), title) for name, title, effort in listed]
    echo_table(("EXPERIMENT", "TIME", "TASKS", "WHAT"), rows)
    echo(f"\nTIME is for {cores} cores, {ESTIMATED_FROM}.")
    echo(
        "The first experiment after an installation also compiles the simulator, which takes some tens of seconds."
    )
    echo(
        "`graspsense experiment NAME --dry-run` says what an experiment consists of; -o seeds=2 makes it shorter."
    )


def _effort_as_json(effort: Effort) -> dict[str, object]:
    values = asdict(effort, filter=lambda field, _: field.name not in ("simulated", "seconds"))
    return {**values, "tasks": effort.tasks, "cpu_seconds": effort.seconds}


def _plan(planned: Planned, results: Results, workers: int) -> None:
    """Print what the experiment consists of, what is done already, and how long it takes."""
    from graspsense.experiments.duration import ESTIMATED_FROM, effort_of

    effort = effort_of(planned)
    echo_values({"dry_run": True, "experiment": planned.name, **_effort_as_json(effort)})
    kind = "simulated grasps" if effort.simulated else "trials"
    trials = "not known before the data set is read" if effort.trials is None else f"{effort.trials} {kind}"
    echo(planned.experiment.question or planned.experiment.title, Style.HEADING)
    echo_entry(
        "tasks", f"{effort.tasks}: {counted(effort.cases, 'case')} with {counted(effort.seeds, 'seed')}"
    )
    names = [case.name for case in planned.cases if case.name]
    if names:
        more = f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else ""
        echo_entry("cases", "; ".join(names[:_MOST_NAMED]) + more)
    echo_entry("grasps" if effort.simulated else "trials", trials)
    if effort.trainings:
        echo_entry("trainings", f"{effort.trainings} models for the rates; controls add to them")
    estimate = f"about {effort.time_on(workers)} with {workers} processes, {ESTIMATED_FROM}"
    echo_entry("time", "no estimate for this kind of data" if effort.seconds is None else estimate)
    echo_entry(
        "results", f"in {results.folder}" + (", where there are some already" if results.any() else "")
    )
    echo("nothing was run")


def _print(summary: Summary, more: Findings | None, account: Account, page: str) -> None:
    from graspsense.experiments.answer import answer

    echo(answer(summary) if more is None else more.answer, Style.HEADING)
    echo()
    if more is None:
        _print_rates(summary)
    else:
        for table in more.tables:
            _print_table(table)
    echo_entries("WARNING", summary.doubts, Style.CAUTION)
    for note in account.notes:
        echo(f"note: {note}", Style.CAUTION, indent=2)
    echo(account.words, Style.GOOD if account.complete else Style.CAUTION)
    for reason, times in Counter(failure.reason for failure in account.failed).items():
        echo(f"  failed {counted(times, 'time')}: {reason}", Style.BAD, indent=2)
    if account.stopped:
        echo(f"  stopped: {account.stopped}", Style.BAD, indent=2)
    if not account.complete:
        echo("  go on with the same command and --resume: it does what is missing and what failed")
    echo_entry("page", page)


def _print_table(table: FoundTable) -> None:
    """Print a table below its title; without rows its note."""
    echo(table.title, Style.HEADING)
    echo_found(table) if table.rows else echo(table.note)
    echo()


def _print_rates(summary: Summary) -> None:
    columns: Mapping[str, Callable[[ConditionResult], str]] = {
        "CASE": lambda condition: condition.name or "-",
        "TARGET": lambda condition: condition.target,
        "RATE": lambda condition: percent(condition.rate.mean),
        "95 %": lambda condition: percentages(condition.rate.interval),
        "PROTOCOL": lambda condition: condition.protocol,
    }
    if summary.conditions:
        echo_rows(summary.conditions, columns)
        echo()
    # What the controls and the trials of the first seed say against the rates, each once.
    several = len(summary.conditions) > 1
    warnings = [
        f"{condition.name}: {warning}" if several else warning
        for condition in summary.conditions
        for warning in condition.of_first_seed.warnings
    ]
    notes = [note for condition in summary.conditions for note in condition.of_first_seed.notes]
    for key, texts, style in (("WARNING", warnings, Style.CAUTION), ("note", notes, None)):
        different = list(dict.fromkeys(texts))
        echo_entries(key, different[:_MOST_NAMED], style)
        if len(different) > _MOST_NAMED:
            echo_entry(key, f"and {len(different) - _MOST_NAMED} more, which --json tells", style)


DEFAULT_PAGE = "comparison.html"


@click.command(short_help="Compare the results of several experiments.")
@click.argument("folders", metavar="A B ...", nargs=-1)
@click.option(
    "--out",
    metavar="FILE.html",
    default=DEFAULT_PAGE,
    show_default=True,
    callback=file_to_write(".html"),
    help="The page.",
)
@json_option("Print the comparison as JSON.")
def compare(folders: tuple[str, ...], out: str) -> None:
    """Compare experiments: their settings, their rates, and the differences from the first one.

    A, B, ... are folders that `graspsense experiment` wrote. The differences are paired by seed where both experiments
    simulate the same trials with the same seeds.
    """
    from graspsense.experiments.comparison import compare_experiments
    from graspsense.experiments.comparison_page import comparison_page, comparison_tables, doubts

    comparison = compare_experiments(folders)
    write_html(Path(out), comparison_page(comparison))
    echo_values({**comparison.as_json(), "page": out})
    echo(comparison.answer, Style.RESULT)
    echo()
    echo_entries("WARNING", doubts(comparison), Style.CAUTION)
    for table in comparison_tables(comparison):
        _print_table(table)
    echo_entry("page", out)
