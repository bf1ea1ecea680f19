"""Tables of features as CSV: one line a trial, one column a feature, and the column that holds the label.

A table that `graspsense export` wrote comes back as the trials of the store: what it says about a trial is never a
feature, and every feature stays one, also where no trial has a value of it.

Text is UTF-8. Columns are separated by commas, semicolons or tabs, whichever the header has most of; numbers have
a decimal point. A unit may stand behind a name: `p_first [m]`. Empty, `nan`, `NA`, `null` and `?` are missing.
"""

from __future__ import annotations

import csv
import io
import math
import os
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from graspsense.core.errors import ConfigError, DataDamaged, suggestion
from graspsense.core.features import UNKNOWN, FeatureTable
from graspsense.core.labelled import Labelled
from graspsense.recording.controls import controls
from graspsense.store.export_table import ABOUT
from graspsense.store.store import NOT_ENDED

MISSING: Final = frozenset({"", "nan", "na", "n/a", "null", "none", "?"})
_HEADING: Final = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]")
_DECIMAL_COMMA: Final = re.compile(r"[-+]?\d+,\d+")


class CsvColumns:
    """A CSV as columns of text, with the line that each row begins in."""

    def __init__(self, path: Path) -> None:
        self.path = path
        text = _text(path)
        header_line = text.lstrip("\r\n").splitlines()[0] if text.strip() else ""
        if not header_line:
            raise DataDamaged(f"{path} is empty: it needs a header line and one line a trial")
        separator = max(",;\t", key=header_line.count)
        reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
        self.lines: list[int] = []
        rows: list[list[str]] = []
        header: list[str] = []
        try:
            for row in reader:
                if not any(cell.strip() for cell in row):
                    continue
                if not header:
                    header = [cell.strip() for cell in row]
                    continue
                if len(row) != len(header):
                    raise DataDamaged(
                        f"{path}, line {reader.line_num}: {len(row)} values where the header names "
                        f"{len(header)} columns"
                    )
                rows.append([cell.strip() for cell in row])
                self.lines.append(reader.line_num)
        except csv.Error as error:
            raise DataDamaged(f"{path}, line {reader.line_num}: {error}") from None
        if not rows:
            raise DataDamaged(f"{path} has a header and no trial: it needs one line a trial")
        self.units: dict[str, str] = {}
        self.names: list[str] = []
        for heading in header:
            match = _HEADING.fullmatch(heading)
            name = match["name"] if match else heading
            if not name:
                raise DataDamaged(f"{path}: column {len(self.names) + 1} has no name in the header")
            if name in self.units:
                raise DataDamaged(f"{path}: two columns are named {name!r}: rename one")
            self.names.append(name)
            self.units[name] = match["unit"].strip() if match else ""
        self.cells = {name: [row[k] for row in rows] for k, name in enumerate(self.names)}

    def __len__(self) -> int:
        return len(self.lines)

    def column(self, name: str, what: str) -> list[str]:
        """Return a column. Raises ConfigError where there is none."""
        if name not in self.cells:
            raise ConfigError(
                f"{self.path} has no column {name!r} ({what}). Its columns: {', '.join(self.names)}."
                + suggestion(name, self.names)
            )
        return self.cells[name]

    def numbers(self, name: str) -> list[float]:
        """Return a column as numbers, NaN where missing. Raises DataDamaged with the line of what is none."""
        values = []
        for line, cell in zip(self.lines, self.column(name, "a feature"), strict=True):
            if cell.lower() in MISSING:
                values.append(math.nan)
                continue
            try:
                value = float(cell.replace("_", "x"))  # Python would read 1_0 as 10
            except ValueError:
                hint = " (write a decimal point)" if _DECIMAL_COMMA.fullmatch(cell) else ""
                raise DataDamaged(
                    f"{self.path}, line {line}: {name} is {cell[:40]!r}, which is no number{hint}"
                ) from None
            if math.isinf(value):
                raise DataDamaged(
                    f"{self.path}, line {line}: {name} is infinite; leave it empty where missing"
                )
            values.append(value)
        return values

    def has_numbers(self, name: str) -> bool:
        """Whether any cell of a column is a number."""
        return any(_is_number(cell) for cell in self.cells[name])

    def rises(self, name: str) -> bool:
        """Whether a column rises with every line, as a counter or a time stamp does, over at least five."""
        values = self.numbers(name)
        return len(values) >= 5 and all(one < other for one, other in pairwise(values))

    def is_blank(self, name: str) -> bool:
        """Whether every cell of a column is missing."""
        return all(cell.lower() in MISSING for cell in self.cells[name])

    def keep(self, rows: Sequence[int]) -> None:
        """Keep these rows only."""
        self.lines = [self.lines[i] for i in rows]
        self.cells = {name: [cells[i] for i in rows] for name, cells in self.cells.items()}

    def table(self, names: Sequence[str]) -> FeatureTable:
        """Return the table of these columns."""
        values = np.array([self.numbers(name) for name in names], dtype=np.float64).T
        return FeatureTable(
            names=tuple(names),
            units=tuple(self.units[name] for name in names),
            values=values.reshape(len(self), len(names)),
        )


def read_labelled(
    path: Path,
    label: str,
    *,
    instance: str | None = None,
    order: str | None = None,
    features: Sequence[str] = (),
    before: Sequence[str] = (),
) -> Labelled:
    """Return the trials of a CSV whose column `label` names what each is of.

    `instance` is the column that names the very thing, `order` a column of numbers that rise in the order of
    recording (without it, that is the order of the lines). In a table that `graspsense export` wrote these are
    known. `features` are the columns to learn from, by default all that hold numbers and have no other meaning;
    `before` are those known before any contact, of which the control from before the contact is made; they are
    features too unless `features` leaves them out.

    Raises ConfigError where a column is not there or is no label, DataDamaged where the file is not what it
    claims to be.
    """
    columns = CsvColumns(path)
    notes: list[str] = []
    simulated = False
    if _is_export(columns):
        _keep_counted(columns, label, notes)
        order = order or "trial"
        if instance is None and not any(cell.lower() in MISSING for cell in columns.cells["instance"]):
            instance = "instance"
        features = features or columns.names[len(ABOUT) :]
        simulated = "1" in columns.cells["simulated"]
    labels = _labels(columns, label)
    things = None if instance is None else _named(columns, instance, "the instance")
    taken = {label, *([instance] if instance else []), *([order] if order else [])}
    names = list(features) or _feature_names(columns, taken, notes)
    for name in names:
        if name in taken:
            raise ConfigError(f"{name!r} is no feature here: it is the label, the instance or the order")
    table = columns.table(names)
    _note_dull_columns(table, notes)
    near = {one.casefold(): one for one in labels}
    for one in sorted(set(labels)):
        if near[one.casefold()] != one:
            notes.append(f"labels {one!r} and {near[one.casefold()]!r} differ in case only and count as two")
    if order is None:
        notes.append("no column of order named: the lines are taken to be in the order of recording")
        ranks = tuple(range(len(columns)))
    else:
        when = columns.numbers(order)
        if any(math.isnan(one) for one in when):
            raise DataDamaged(f"{path}: the column {order!r} gives no order: a cell of it is empty")
        ranks = tuple(np.argsort(np.argsort(when, kind="stable"), kind="stable").tolist())
    return Labelled(
        source=str(path),
        table=table,
        labels=tuple(labels),
        instances=None if things is None else tuple(things),
        no_instances="no column names the instance (--instance COLUMN)",
        order=ranks,
        **controls(
            table,
            columns.table(list(before)) if before else None,
            before_what=f"only {', '.join(before)}",
            no_before="no columns are named as known before contact (--before COLUMNS)",
        ),
        notes=tuple(notes),
        provenance={"simulated": simulated},
    )


def read_table(path: Path, names: Sequence[str]) -> FeatureTable:
    """Return these columns of a CSV. Raises ConfigError, DataDamaged."""
    return CsvColumns(path).table(list(names))


def write_labelled(path: Path, labelled: Labelled) -> None:
    """Write labels, instances, order and features, so that `read_labelled` gives the same table. Raises OSError."""
    table = labelled.table
    extra: dict[str, Sequence[object]] = {"label": labelled.labels}
    if labelled.instances is not None:
        extra["instance"] = labelled.instances
    if labelled.order is not None:
        extra["order"] = labelled.order
    headings = [
        f"{name} [{unit}]" if unit else name for name, unit in zip(table.names, table.units, strict=True)
    ]
    part = path.with_name(path.name + ".part")
    with part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*extra, *headings])
        for i, row in enumerate(table.values.tolist()):
            cells = ["" if math.isnan(value) else repr(value) for value in row]
            writer.writerow([*(column[i] for column in extra.values()), *cells])
    os.replace(part, path)


def _text(path: Path) -> str:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}") from error
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise DataDamaged(f"{path} is UTF-16: save it as UTF-8")
    if b"\0" in data:
        raise DataDamaged(f"{path} holds zero bytes: it is no text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DataDamaged(
            f"{path}, line {line}: byte 0x{data[error.start]:02x} is not UTF-8: save the file as UTF-8"
        ) from None


def _labels(columns: CsvColumns, label: str) -> list[str]:
    labels = _named(columns, label, "the label")
    if len(set(labels)) > max(2, len(labels) // 2):
        raise ConfigError(
            f"column {label!r} of {columns.path} has {len(set(labels))} different values in {len(labels)} trials: "
            "that is no label. Name the column that says what was grasped"
        )
    if UNKNOWN in labels:
        raise ConfigError(
            f"{columns.path}: {UNKNOWN!r} is no label: it is the answer to a thing unlike any other"
        )
    return labels


def _named(columns: CsvColumns, name: str, what: str) -> list[str]:
    cells = columns.column(name, what)
    for line, cell in zip(columns.lines, cells, strict=True):
        if cell.lower() in MISSING:
            raise DataDamaged(f"{columns.path}, line {line}: {name} ({what}) is empty")
    return cells


def _is_export(columns: CsvColumns) -> bool:
    """Whether `graspsense export` wrote this table of a store's trials."""
    return tuple(columns.names[: len(ABOUT)]) == ABOUT


def _keep_counted(columns: CsvColumns, label: str, notes: list[str]) -> None:
    """Keep the trials that `store:` would give: labelled, and ended by themselves. Raises DataDamaged."""
    labels, outcomes = columns.column(label, "the label"), columns.cells["outcome"]
    named = [i for i, cell in enumerate(labels) if cell.lower() not in MISSING]
    ended = [i for i in named if outcomes[i] not in NOT_ENDED]
    if len(named) < len(columns):
        notes.append(f"{len(columns) - len(named)} trials left out: they have no label")
    if len(ended) < len(named):
        notes.append(f"{len(named) - len(ended)} trials left out: they did not end by themselves")
    if not ended:
        raise DataDamaged(f"{columns.path} has no labelled trial that ended by itself")
    columns.keep(ended)


def _feature_names(columns: CsvColumns, taken: set[str], notes: list[str]) -> list[str]:
    names, left, counters, blank = [], [], [], []
    for name in columns.names:
        if name in taken:
            continue
        if columns.is_blank(name) and not columns.units[name]:
            blank.append(name)
        elif not (columns.has_numbers(name) or columns.is_blank(name)):
            left.append(name)
        elif columns.rises(name):
            counters.append(name)
        else:
            names.append(name)
    if counters:
        notes.append(
            f"not used, as they rise with every line like a counter or a time: {', '.join(counters)} "
            "(--features takes them in)"
        )
    if blank:
        notes.append(f"not used, as they hold no value: {', '.join(blank)} (--features takes them in)")
    if left:
        notes.append(f"not used, as they hold no numbers: {', '.join(left)}")
    if blank and not names:
        raise DataDamaged(f"no feature has a single value: {', '.join(blank)}")
    if not names:
        raise ConfigError(f"{columns.path} has no column of numbers besides {', '.join(sorted(taken))}")
    return names


def _note_dull_columns(table: FeatureTable, notes: list[str]) -> None:
    blank = [name for k, name in enumerate(table.names) if np.isnan(table.values[:, k]).all()]
    known = [name for name in table.names if name not in blank]
    ends = {name: table.columns([name]).values for name in known}
    constant = [name for name in known if np.nanmin(ends[name]) == np.nanmax(ends[name])]
    if blank:
        notes.append(f"without a single value: {', '.join(blank)}")
    if constant:
        notes.append(f"constant, so that they tell nothing apart: {', '.join(constant)}")
    share = float(np.isnan(table.values).mean())
    if share > 0.0:
        notes.append(f"{share:.1%} of all values are missing")
    if len(blank) == len(table.names):
        raise DataDamaged(f"no feature has a single value: {', '.join(blank)}")


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False
