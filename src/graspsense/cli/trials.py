"""`graspsense trials`: the trials of a store, their labels and numbers, and which of them are set aside."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from attrs import asdict

from graspsense.cli.output import echo_values, json_option
from graspsense.cli.sources import named_store
from graspsense.cli.terminal import Subcommands, echo, echo_rows, echo_table
from graspsense.core.learn.target_value import value_label
from graspsense.core.settings.resolved import settings_from
from graspsense.core.values.errors import ConfigError, GraspsenseError
from graspsense.store import changes
from graspsense.store.labels import agrees, labels_of

if TYPE_CHECKING:
    from graspsense.store.rows import StoredTrial
    from graspsense.store.store import Store

HEADER: Final = ("TRIAL", "MADE", "LABEL", "INSTANCE", "OUTCOME", "GRIPPER", "STATE")

_REFS = click.argument("refs", nargs=-1, required=True, metavar="DIR#NUMBER...")
_WHY = click.option("--why", metavar="TEXT", default="", help="Reason, kept in the history.")
_JSON = json_option()


@click.group(cls=Subcommands)
def trials() -> None:
    """List, relabel and set aside the trials of a store, and change their numbers.

    Nothing is deleted: every change is kept in the store (`history`), and can be reversed.
    """


@trials.command("list")
@click.argument("folder", metavar="DIR", callback=named_store)
@click.option("--label", metavar="CLASS:STATE", help="Only trials with this label.")
@click.option("--aside/--not-aside", default=None, help="Only trials that are set aside, or only the others.")
@click.option("--limit", type=click.IntRange(min=1), default=50, show_default=True, help="Number of trials.")
@_JSON
def list_trials(folder: str, label: str | None, aside: bool | None, limit: int) -> None:
    """List the newest trials of the store DIR, newest first."""
    from graspsense.store.store import Store

    with Store.read(folder) as store:
        page = store.page(label=label, set_aside=aside, limit=limit)
        every = changes.history(store)
    last_relabel = {change.trial: change for change in every if change.action == "relabel"}
    echo_values([{**asdict(trial), "relabelled": trial.id in last_relabel} for trial in page])
    rows = []
    for trial in page:
        states = [f"set aside: {trial.set_aside}" if trial.set_aside is not None else ""]
        if trial.id in last_relabel:
            states.append(last_relabel[trial.id].words)
        made = trial.made_at[:16].replace("T", " ")
        outcome = trial.outcome if trial.complete else f"{trial.outcome}, incomplete"
        cells = (str(trial.id), made, trial.label or "", trial.instance or "", outcome, trial.device)
        rows.append((*cells, "; ".join(state for state in states if state)))
    if not rows:
        echo(f"no trial of {folder} matches")
    echo_table(HEADER, rows)


@trials.command()
@_REFS
@click.option("--label", metavar="CLASS:STATE", help="The new label: can:full_open, or can:full_open#2.")
@click.option("--as-recorded", is_flag=True, help="Restore the label with which the trial was recorded.")
@_WHY
@_JSON
def relabel(refs: Sequence[str], label: str | None, as_recorded: bool, why: str) -> None:
    """Change the label of trials; `history` shows the one before.

    A trial of a simulated gripper keeps the label of the object that was simulated.
    """
    if (label is None) != as_recorded:
        raise click.UsageError("give either --label CLASS:STATE or --as-recorded")
    labels = None if label is None else labels_of(label)

    def change(store: Store, numbers: Sequence[int]) -> None:
        if label is not None:
            for number in numbers:
                _refuse_contradiction(store.trial(number), label)
        changes.relabel(store, numbers, labels, why)

    _change(refs, change)


@trials.command("value")
@_REFS
@click.option("--value", metavar="NAME[UNIT]=NUMBER", help='The new number: "fill [ml]=250".')
@click.option(
    "--as-recorded", metavar="NAME", help="Restore the number that the trial was recorded with, or none."
)
@_WHY
@_JSON
def change_value(refs: Sequence[str], value: str | None, as_recorded: str | None, why: str) -> None:
    """Change a number to predict of trials, or give them one; `history` shows the one before.

    `train`, `evaluate` and `report` use these numbers with --target-value.
    """
    if (value is None) == (as_recorded is None):
        raise click.UsageError('give either --value "NAME [UNIT]=NUMBER" or --as-recorded NAME')
    heading, cell = (as_recorded or "", None) if value is None else value_label(value)
    _change(refs, lambda store, numbers: changes.set_number(store, numbers, heading, cell, why))


@trials.command()
@_REFS
@click.option("--why", metavar="TEXT", required=True, help="Reason, shown in lists and kept in the history.")
@_JSON
def aside(refs: Sequence[str], why: str) -> None:
    """Set trials aside: they stay in the store, but are not counted, exported as a table, or learned from."""
    _change(refs, lambda store, numbers: changes.set_aside(store, numbers, why))


@trials.command()
@_REFS
@_WHY
@_JSON
def restore(refs: Sequence[str], why: str) -> None:
    """Bring trials back that were set aside."""
    _change(refs, lambda store, numbers: changes.restore(store, numbers, why))


@trials.command("history")
@click.argument("source", metavar="DIR|DIR#NUMBER", callback=named_store)
@_JSON
def show_history(source: str) -> None:
    """Print the changes of all trials of the store DIR, or of one trial, the oldest first."""
    from graspsense.store.store import Store
    from graspsense.store.stored_grasps import parse_trial_ref

    folder, number = (source, None) if Path(source).is_dir() else parse_trial_ref(source)
    with Store.read(folder) as store:
        history = changes.history(store, number)
    echo_values([change.as_json() for change in history])
    if not history:
        echo("nothing was changed after recording")
    echo_rows(
        history,
        {
            "TRIAL": lambda change: str(change.trial),
            "WHEN": lambda change: change.made_at[:19].replace("T", " ") or "unknown",
            "CHANGE": lambda change: change.words,
            "WHY": lambda change: change.why,
        },
    )


def _change(refs: Sequence[str], change: Callable[[Store, Sequence[int]], None]) -> None:
    """Change trials of one store, all or none, and print what was done to each."""
    from graspsense.store.store import Store
    from graspsense.store.stored_grasps import parse_trial_ref

    trials = [parse_trial_ref(ref) for ref in refs]
    folders = {folder for folder, _ in trials}
    if len(folders) > 1:
        raise click.UsageError(
            f"these trials are of several stores: {', '.join(sorted(folders))}. Name those of one"
        )
    (folder,) = folders
    Store.read(folder).close()  # a store that does not exist is not created
    with Store.open(folder) as store:
        earlier = len(changes.history(store))
        change(store, [number for _, number in trials])
        done = changes.history(store)[earlier:]
    echo_values({"store": folder, "changes": [made.as_json() for made in done]})
    for made in done:
        echo(f"trial {made.trial}: {made.words}" + (f" ({made.why})" if made.why else ""), indent=2)


def _refuse_contradiction(trial: StoredTrial, label: str) -> None:
    """Refuse a label that contradicts the object that was simulated. Raises ConfigError."""
    recorded: Mapping[str, Mapping[str, Any]] = trial.record.settings
    held = recorded.get("gripper", {}).get("object")
    if not trial.summary.simulated or held is None:
        return
    try:
        tables = {name: table for name, table in recorded.items() if name != "classifier"}
        agree = agrees(settings_from(tables, f"trial {trial.summary.id}"), label)
    except GraspsenseError:
        return  # its gripper is not installed here
    if not agree:
        raise ConfigError(
            f"trial {trial.summary.id} was simulated with {held}, so it cannot be a {label}. Set it aside, or label it "
            "with what was simulated"
        )
