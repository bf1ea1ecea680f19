"""Changes of stored trials: labels, numbers to predict, and which are set aside. All are kept, and can be reversed.

A change and the trial that it changes are written in one transaction. The label as it was recorded stays in the
recording and in the column `labels` of the table `detail`. So does a number to predict: its changes are applied when
trials are read, by `with_changed_numbers`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final, Literal

from attrs import astuple, evolve, frozen

from graspsense.core.learn.target_value import name_and_unit
from graspsense.core.values.errors import ConfigError
from graspsense.store.labels import word_of
from graspsense.store.opening import damaged, decoded

if TYPE_CHECKING:
    import sqlite3

    from graspsense.store.rows import EncodedRow, TrialSummary
    from graspsense.store.store import Store

Action = Literal["relabel", "value", "aside", "restore"]


@frozen
class Change:
    """One change of a trial.

    `old` and `new` are labels as they are typed (`can:full_open#2`), or numbers to predict (`fill [ml]=250`), None
    where there is none. `made_at` is empty for a trial that an earlier version of graspsense set aside.
    """

    id: int
    trial: int
    made_at: str
    action: Action
    old: str | None
    new: str | None
    why: str

    @property
    def words(self) -> str:
        """The change in words."""
        if self.action == "relabel":
            return f"relabelled from {self.old or 'no label'} to {self.new or 'no label'}"
        if self.action == "value":
            return f"number changed from {self.old or 'none'} to {self.new or 'none'}"
        return "set aside" if self.action == "aside" else "brought back"

    def as_json(self) -> dict[str, Any]:
        """Return the columns of the change as JSON values."""
        return dict(zip(COLUMNS, astuple(self), strict=True))


COLUMNS: Final = ("id", "trial", "made_at", "action", "before", "after", "why")


def history(store: Store, number: int | None = None) -> list[Change]:
    """Return the changes of a trial, or of all trials, the oldest first. Raises ConfigError for an unknown trial."""
    if number is not None:
        store.summary(number)
    where = "" if number is None else "WHERE trial = ? "
    values = () if number is None else (number,)
    columns = ", ".join(f'"{name}"' for name in COLUMNS)
    rows = store.query(f"SELECT {columns} FROM change {where}ORDER BY id", values)
    return [Change(*row) for row in rows]


def set_aside(store: Store, numbers: Sequence[int], why: str) -> None:
    """Set trials aside: they stay in the store, but are neither counted nor learned from.

    Raises ConfigError, before anything is changed, if a trial does not exist or is set aside already; SaveFailed.
    """
    _set_state(store, numbers, "aside", why)


def restore(store: Store, numbers: Sequence[int], why: str) -> None:
    """Bring trials back that were set aside.

    Raises ConfigError, before anything is changed, if a trial does not exist or is not set aside; SaveFailed.
    """
    _set_state(store, numbers, "restore", why)


def _set_state(store: Store, numbers: Sequence[int], action: Action, why: str) -> None:
    aside = action == "aside"

    def change(connection: sqlite3.Connection, trial: TrialSummary) -> None:
        if (trial.set_aside is not None) == aside:
            state = f"is set aside already: {trial.set_aside}" if aside else "is not set aside"
            raise ConfigError(f"trial {trial.id} {state}")
        connection.execute("UPDATE trial SET set_aside = ? WHERE id = ?", (why if aside else None, trial.id))
        _keep(connection, trial.id, action, None, None, why)

    _for_each(store, numbers, change)


def relabel(store: Store, numbers: Sequence[int], labels: Mapping[str, str] | None, why: str) -> None:
    """Give trials the labels that `labels_of` returned, or with None those that they were recorded with.

    Raises ConfigError, before anything is changed, if a trial does not exist or has this label already; SaveFailed,
    DataDamaged.
    """

    def change(connection: sqlite3.Connection, trial: TrialSummary) -> None:
        sha256, row = store.encoded_row(trial.id)
        if sha256 != row.sha256:
            raise damaged(store.folder, f"the row of trial {trial.id} was changed after it was written")
        wanted = json.loads(row.detail["labels"]) if labels is None else labels
        label, instance = wanted.get("label"), wanted.get("instance")
        if (label, instance) == (trial.label, trial.instance):
            raise ConfigError(f"trial {trial.id} has the label {word_of(label, instance) or 'none'} already")
        changed: EncodedRow = evolve(row, trial={**row.trial, "label": label, "instance": instance})
        connection.execute(
            "UPDATE trial SET label = ?, instance = ?, sha256 = ? WHERE id = ?",
            (label, instance, changed.sha256, trial.id),
        )
        old, new = word_of(trial.label, trial.instance), word_of(label, instance)
        _keep(connection, trial.id, "relabel", old, new, why)

    _for_each(store, numbers, change)


def set_number(store: Store, numbers: Sequence[int], heading: str, cell: str | None, why: str) -> None:
    """Give trials this number to predict; `heading` is its name with its unit, `cell` the number as text.

    With None as `cell`, each trial gets the number of this name back that it was recorded with, or none. Raises
    ConfigError, before anything is changed, if a trial does not exist, has this number already, or if other trials have
    it in another unit; SaveFailed, DataDamaged.
    """
    name, _ = name_and_unit(heading)
    with store.transaction() as connection:
        recorded, current = _labels_of_trials(store)
        if cell is not None:
            _refuse_another_unit(heading, [current[number] for number in current.keys() - set(numbers)])
        for number in dict.fromkeys(numbers):
            store.trial(number)
            old = _number_named(current[number], name)
            new = _number_named(recorded[number], name) if cell is None else f"{heading}={cell}"
            if old == new:
                raise ConfigError(f"trial {number} has {new or f'no number {name!r}'} already")
            _keep(connection, number, "value", old, new, why)


def refuse_other_units(store: Store, headings: Iterable[str]) -> None:
    """Raise ConfigError if trials of the store have one of these numbers in another unit; DataDamaged."""
    wanted = list(headings)
    if wanted:
        _, current = _labels_of_trials(store)
        for heading in wanted:
            _refuse_another_unit(heading, current.values())


def _labels_of_trials(store: Store) -> tuple[dict[int, Mapping[str, str]], dict[int, Mapping[str, str]]]:
    """Return the labels of each trial as recorded, and with the numbers that were changed since. Raises DataDamaged."""
    rows = store.query("SELECT trial, labels FROM detail ORDER BY trial")
    recorded: dict[int, Mapping[str, str]] = {number: decoded(store.folder, text) for number, text in rows}
    current = with_changed_numbers(store, list(recorded), list(recorded.values()))
    return recorded, dict(zip(recorded, current, strict=True))


def _refuse_another_unit(heading: str, others: Iterable[Mapping[str, str]]) -> None:
    """Raise ConfigError if these labels have the number of this name, but none in its unit."""
    name, unit = name_and_unit(heading)
    pairs = {name_and_unit(other) for labels in others for other in labels}
    units = {other for known, other in pairs if known == name}
    if units and unit not in units:
        (other, *_) = sorted(units)
        raise ConfigError(
            f"{name} of other trials is in {other or 'no unit'}, and {heading!r} cannot be compared with them: "
            f"write {f'{name} [{other}]' if other else name}=NUMBER, or change all of them with graspsense trials value"
        )


def with_changed_numbers(
    store: Store, trials: Sequence[int], labels: Sequence[Mapping[str, str]]
) -> list[Mapping[str, str]]:
    """Return the labels of these trials with the numbers to predict that were changed after recording."""
    changed: dict[int, list[tuple[str | None, str | None]]] = {}
    rows = store.query("""SELECT trial, "before", "after" FROM change WHERE "action" = 'value' ORDER BY id""")
    for trial, old, new in rows:
        changed.setdefault(trial, []).append((old, new))
    current: list[Mapping[str, str]] = []
    for trial, label in zip(trials, labels, strict=True):
        values = dict(label)
        for old, new in changed.get(trial, ()):
            if old is not None:
                values.pop(old.rpartition("=")[0], None)
            if new is not None:
                heading, _, cell = new.rpartition("=")
                values[heading] = cell
        current.append(values)
    return current


def _number_named(labels: Mapping[str, str], name: str) -> str | None:
    """Return the number of this name as it is typed, None if the trial has none."""
    return next(
        (f"{heading}={cell}" for heading, cell in labels.items() if name_and_unit(heading)[0] == name), None
    )


def inconsistencies(store: Store) -> dict[int, str]:
    """Return the trials whose label or state does not follow from their recording and their changes, and why."""
    labels: dict[int, str | None] = {}
    aside: dict[int, bool] = {}
    problems: dict[int, str] = {}
    for change in history(store):
        if change.action == "relabel":
            labels[change.trial] = change.new
        elif change.action in ("aside", "restore"):
            aside[change.trial] = change.action == "aside"
        elif change.action != "value":
            problems[change.trial] = f"its history has the unknown action {change.action!r}"
    columns = store.columns(("id", "label", "instance", "set_aside", "labels"), "TRUE")
    for number, label, instance, why, recorded in zip(*columns.values(), strict=True):
        try:
            grasped = json.loads(recorded)
            expected = labels.get(number, word_of(grasped.get("label"), grasped.get("instance")))
        except (ValueError, AttributeError, TypeError):
            problems[number] = "its recorded labels cannot be read"
            continue
        if word_of(label, instance) != expected:
            problems[number] = f"its label is not the one of its history ({expected or 'none'})"
        elif (why is not None) != aside.get(number, False):
            problems[number] = "its history does not say that it was set aside or brought back"
    return problems


def _for_each(
    store: Store, numbers: Sequence[int], change: Callable[[sqlite3.Connection, TrialSummary], None]
) -> None:
    """Change all these trials in one transaction, or none of them."""
    with store.transaction() as connection:
        for number in dict.fromkeys(numbers):
            change(connection, store.summary(number))


def _keep(
    connection: sqlite3.Connection,
    trial: int,
    action: Action,
    old: str | None,
    new: str | None,
    why: str,
) -> None:
    made_at = datetime.now(UTC).isoformat(timespec="milliseconds")
    connection.execute(
        'INSERT INTO change (trial, made_at, "action", "before", "after", why) VALUES (?, ?, ?, ?, ?, ?)',
        (trial, made_at, action, old, new, why),
    )
