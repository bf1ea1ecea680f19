"""Labelled trials from a CSV table: one line per trial, one column per feature, and a column with the label.

A table that `graspsense export` wrote gives the same trials as the store that it was exported from: the columns that
describe a trial are never features, and every feature remains one even if no trial has a value of it.
"""

from __future__ import annotations

import fnmatch
import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.components.caller import option
from graspsense.core.files.csv_text import csv_text
from graspsense.core.files.whole_file import write_or_replace
from graspsense.core.learn.confounding import LEAST_LINES
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.target_value import TargetValue
from graspsense.core.values.errors import ConfigError, DataDamaged, listed
from graspsense.core.values.features import UNKNOWN, FeatureTable
from graspsense.core.values.label_text import is_missing_label, label_text
from graspsense.core.values.nominal import splits_of
from graspsense.core.values.written_numbers import NotNumbers, is_missing
from graspsense.recording.controls import Controls, controls
from graspsense.sources.formats.arff_columns import ArffColumns
from graspsense.sources.formats.csv_columns import CsvColumns
from graspsense.sources.trial_table.doubtful_columns import doubts
from graspsense.sources.trial_table.exported_table import ExportedTable, exported
from graspsense.sources.trial_table.identifiers import (
    OF_OBJECTS,
    groups_trials,
    identifies,
    names_a_recording,
    text_identifies,
)
from graspsense.sources.trial_table.summary_lines import without_summaries
from graspsense.store.export_table import VALUE

if TYPE_CHECKING:
    from graspsense.sources.formats.table import Numbers

_ROUNDING: Final = (1e-3, 1e-13)
"""Variation, also relative to the largest value, that is only rounding, and no measurement, as in C4.5 trees."""
_QUANTITY: Final = frozenset({
    "variable", "quantity", "parameter", "param", "channel", "feature", "measure", "measurement", "metric", "attribute",
    "merkmal", "gr\u00f6\u00dfe", "messgr\u00f6\u00dfe", "kennwert", "grandeur", "magnitud", "grandezza",
})  # fmt: skip
_VALUE: Final = frozenset({"value", "values", "val", "wert", "messwert", "valeur", "valor", "valore"})
LARGEST_WHOLE: Final = 2.0**53
"""From here on, not every whole number is a number of the computer."""


def read_labelled(
    path: Path,
    label: str | None,
    *,
    instance: str | None = None,
    order: str | None = None,
    features: Sequence[str] = (),
    known_before: Sequence[str] = (),
    value: str | None = None,
) -> Labelled:
    """Return the trials of a CSV file; the column `label` says what was grasped.

    `instance` is the column that identifies the individual object (default: the column `instance`, or the only one
    whose values name objects), `order` a column of numbers that increase in the order of recording (default: the order
    of the lines). Both are known in a table that `graspsense export` wrote.
    `features` are the columns to learn from, by default all that have no other meaning; `pad_*` is all that begin so,
    and `-NAME` leaves one out. Those of `known_before` are known before contact, for the control; they are features
    unless `features` leaves them out. With `value`, this column of numbers is the target; lines without it are left
    out, and no label is needed.

    Raises ConfigError if a column does not exist or cannot be a label, DataDamaged if the file is not a valid table.
    """
    columns, export, label = _opened(path, label, instance, order)
    notes = list(columns.notes)
    if export is not None:
        export.keep_complete_trials(label if value is None else None, notes)
    elif isinstance(columns, ArffColumns) and value is None:
        notes += columns.without_label(label or "")
    target = None if value is None else _target(columns, value, export, notes)
    labels = _labels(columns, label, notes, required=target is None)
    ranks, no_order = export.order() if export and order is None else (_ranks(columns, order), "")
    # No feature of an exported store identifies trials: a feature set made it.
    lines = _lines_once(columns, {order, columns.index}, labels)
    identified = (lambda _: "") if export is not None else _identifying(columns, labels, ranks, lines)
    if instance is None and (target is None or export is not None):
        instance = _object_column(columns, {label, order, columns.index, *features}, identified, notes)
    instances = None if instance is None else tuple(columns.complete_column(instance, "the instance"))
    reserved = {name for name in (label, instance, order, value) if name}
    table = _feature_table(columns, features, export.features if export else [], reserved, identified, notes)
    others = [name for name in columns.names if name not in {*reserved, *table.names}]
    if export is None:
        recorded = lines if ranks is None else sorted(lines, key=ranks.__getitem__)
        notes += [] if order is not None else [_no_order(columns, reserved, identified)]
        notes += doubts(columns, labels, table, target, recorded)
        notes += map(_not_held_out, _sessions(columns, others, instances))
    return Labelled(
        source=str(path),
        table=table,
        labels=tuple(labels),
        instances=instances,
        no_instances=f"no column names the instance ({option('instance', 'COLUMN')})",
        sessions=bool(_sessions(columns, [instance] if instance else [])),
        recorded_with=_sessions(columns, others),
        order=ranks,
        no_order=no_order,
        **_controls(table, columns, known_before, export),
        value=target,
        notes=tuple(notes),
        provenance={"simulated": export is not None and "1" in columns.cells["simulated"]},
    )


def _not_held_out(name: str) -> str:
    return (
        f"not held out: trials of one {name} are in training and test data. If it matters, a further {name} is "
        f"recognised less often than told; {option('instance', name)} holds it out"
    )


def _opened(
    path: Path, label: str | None, instance: str | None, order: str | None
) -> tuple[CsvColumns, ExportedTable | None, str | None]:
    """Return the columns of a file, the same if they were exported, and the label. Raises ConfigError, DataDamaged."""
    columns = columns_of_file(path)
    export = exported(columns)
    label = label or columns.default_label or ("label" if export is not None else None)
    if label is not None and label in {instance, order}:
        raise ConfigError(
            f"{label!r} is the label: {option('instance', 'COLUMN')} names another column, which tells its objects "
            f"apart, and {option('order', 'COLUMN')} that of the order of recording"
        )
    no_features = {label, instance or "instance", order}
    columns.take_words_as_missing([name for name in columns.names if name not in no_features])
    return columns, export, label


def _sessions(
    columns: CsvColumns, names: Sequence[str], instances: Sequence[str] | None = None
) -> dict[str, tuple[str, ...]]:
    """Return the texts of those columns that name sessions, operators or devices, which no instances hold out."""
    texts = {name: tuple(columns.texts(name)) for name in names}
    return {name: values for name, values in texts.items() if groups_trials(name, values, instances)}


def _object_column(
    columns: CsvColumns, others: set[str | None], identified: Callable[[str], str], notes: list[str]
) -> str | None:
    """Return the column `instance`, or the only one that names the objects, and note it; None if there is none.

    `others` are the columns with another meaning.
    """
    possible = [name for name in columns.names if name not in others and not columns.is_blank(name)]
    named = [name for name in possible if name == "instance"] or [
        name for name in possible if identified(name) in OF_OBJECTS
    ]
    if len(named) != 1 or any(map(is_missing_label, columns.cells[named[0]])):
        return None
    notes.append(
        f"the trials of an object are held out together: {named[0]} names the objects "
        f"({option('instance', 'COLUMN')} names another column)"
    )
    return named[0]


def _identifying(
    columns: CsvColumns, labels: Sequence[str], ranks: Sequence[int] | None, lines: Sequence[int]
) -> Callable[[str], str]:
    """Return a function that says how a column identifies trials in these lines; empty if it can be a feature.

    It raises DataDamaged.
    """
    columns, labels = columns.rows(lines), [labels[i] for i in lines]
    order = None if ranks is None else [ranks[i] for i in lines]

    @cache
    def identified(name: str) -> str:
        if columns.is_nominal(name):
            why = text_identifies(columns.texts(name), labels)
        else:
            values = columns.numbers(name)
            why = identifies(name, columns.units[name], values, labels, order)
            if not why and _loses_digits(columns.cells[name], values):
                why = "differ in their last digits alone, which are rounding (subtract an offset)"
        if not why and names_a_recording(name):
            return "tell of the recording and not of the grasp, by their name"
        return why

    return identified


def _refuse_long_form(columns: CsvColumns) -> None:
    """Raise DataDamaged if a column names what the number in another one is, so that a trial has several lines."""
    names = {name.lower(): name for name in columns.names}
    quantity = next((names[word] for word in _QUANTITY if word in names), None)
    if quantity and columns.is_nominal(quantity) and _VALUE & names.keys():
        raise DataDamaged(
            f"{columns.path} has a line for each {quantity} of a trial: write one line per trial, with a column for "
            f"each {quantity}"
        )


def _lines_once(columns: CsvColumns, counted_by: set[str | None], labels: Sequence[str]) -> list[int]:
    """Return the first of equal lines where a whole table is repeated, else all lines.

    Its copies would hide what its columns are. `counted_by` are columns that number the lines. A table with few
    different lines repeats them by chance.
    """
    cells = [texts for name, texts in columns.cells.items() if name not in counted_by]
    lines = list(zip(*cells, strict=True))
    originals = {line: i for i, line in reversed(list(enumerate(lines)))}
    repeated = len(originals) >= LEAST_LINES * len(set(labels)) and len(set(Counter(lines).values())) == 1
    return sorted(originals.values()) if repeated else list(range(len(lines)))


def _controls(
    table: FeatureTable, columns: CsvColumns, known_before: Sequence[str], export: ExportedTable | None
) -> Controls:
    """Return the controls: of an exported store the same as those of the store, unless `known_before` names some."""
    if export is not None and not known_before and (earlier := export.before_contact()) is not None:
        return controls(table, earlier, first_line=export.first_line())
    return controls(
        table,
        columns.table(list(known_before)) if known_before else None,
        before_what=f"only {', '.join(known_before)}",
        no_before=f"no columns are named as known before contact ({option('before', 'COLUMNS')})",
    )


def _target(columns: CsvColumns, value: str, export: ExportedTable | None, notes: list[str]) -> TargetValue:
    """Keep the lines that have the number to predict, and return the numbers. Raises ConfigError, DataDamaged."""
    name = value if export is None or value in columns.cells else f"{VALUE}{value}"
    columns.column(name, "the number to predict")
    having = [not math.isnan(number) for number in columns.numbers(name)]
    if not any(having):
        raise DataDamaged(f"{columns.path}: no line has a {value}")
    notes += columns.keep_where(having, f"no {value}")
    return TargetValue(name=value, unit=columns.units[name], values=tuple(columns.numbers(name)))


def read_table(path: Path, names: Sequence[str]) -> tuple[FeatureTable, tuple[str, ...]]:
    """Return these columns of a CSV file, and what was left out of it. Raises ConfigError, DataDamaged."""
    columns = columns_of_file(path)
    columns.take_words_as_missing(names)
    return columns.table(list(names)), (*columns.notes, *columns.unknown_values(names))


def columns_of_file(path: Path) -> CsvColumns:
    """Return the columns of a table, which is an ARFF file if its name says so. Raises ConfigError, DataDamaged."""
    columns = ArffColumns(path) if path.suffix.lower() == ".arff" else CsvColumns(path)
    without_summaries(columns)
    return columns


def write_labelled(path: Path, labelled: Labelled) -> None:
    """Write labels, instances, order and features; `read_labelled` returns the same table. Raises SaveFailed."""
    table = labelled.table
    extra: dict[str, Sequence[object]] = {"label": labelled.labels}
    if labelled.instances is not None:
        extra["instance"] = labelled.instances
    if labelled.order is not None:
        extra["order"] = labelled.order
    headings = [
        f"{name} [{unit}]" if unit else name for name, unit in zip(table.names, table.units, strict=True)
    ]
    rows = [[*(column[i] for column in extra.values()), *row] for i, row in enumerate(table.values.tolist())]
    write_or_replace(path, csv_text([[*extra, *headings], *rows]).encode())


def _labels(columns: CsvColumns, label: str | None, notes: list[str], *, required: bool) -> list[str]:
    """Return the labels. Trials whose target is a number may lack them. Raises ConfigError, DataDamaged."""
    if not required:
        return [""] * len(columns) if label is None else list(columns.column(label, "the label"))
    if label is None:
        raise ConfigError(
            f"which column of {columns.path} holds the label? Name it: {option('label', 'COLUMN')}"
        )
    written = columns.complete_column(label, "the label")
    labels = [label_text(name) for name in written]
    if words := sorted({label for label in labels if is_missing(label)}):
        notes.append(f"taken as labels, not as missing ones: {listed(words)}")
    if len(set(written)) > len(set(labels)):
        notes.append("labels that differ in invisible characters, or as 1 and 1.0 do, count as one")
    if len(set(labels)) > max(LEAST_LINES, len(labels) // 2):
        raise ConfigError(
            f"column {label!r} of {columns.path} has {len(set(labels))} different values in {len(labels)} trials, so "
            "it cannot be the label. Name the column that says what was grasped"
        )
    if UNKNOWN in labels:
        raise ConfigError(
            f"{columns.path}: {UNKNOWN!r} cannot be a label: it is the prediction for an object unlike all others"
        )
    return labels


def _no_order(columns: CsvColumns, reserved: set[str], identified: Callable[[str], str]) -> str:
    """Return a note that no column was named for the order, with those that have another one than the lines."""
    able = [
        name
        for name in columns.names
        if name not in reserved
        and not isinstance(times := columns.numbers_or_times(name), NotNumbers)
        and len(set(times[np.isfinite(times)].tolist())) == len(times)
        and (np.diff(times) < 0.0).any()
        and identified(name)
    ]
    named = f". If it is that of {listed(able)}, name it ({option('order', 'COLUMN')})" if able else ""
    return f"no column names the order of recording: the order of the lines is used{named}"


def _ranks(columns: CsvColumns, order: str | None) -> tuple[int, ...]:
    """Return the position of each trial in the order of recording. Raises DataDamaged."""
    if order is None:
        return tuple(range(len(columns)))
    values = columns.numbers(order, "the order")
    if any(math.isnan(value) for value in values):
        raise DataDamaged(f"{columns.path}: a cell of the column {order!r} (the order) is empty")
    return tuple(np.argsort(np.argsort(values, kind="stable"), kind="stable").tolist())


def _loses_digits(cells: Sequence[str], values: Sequence[float]) -> bool:
    """Return whether different whole numbers are the same number, or all numbers are but for rounding."""
    known = np.array([value for value in values if value == value])
    if len(known) and 0.0 < _span(known) < min(np.multiply(_ROUNDING, (1.0, np.abs(known).max()))):
        return True
    return len(set(values)) < len(set(cells)) and any(abs(value) >= LARGEST_WHOLE for value in values)


def _feature_table(
    columns: CsvColumns,
    features: Sequence[str],
    usual: Sequence[str],
    reserved: set[str],
    identified: Callable[[str], str],
    notes: list[str],
) -> FeatureTable:
    """Return the columns of `features`, or the usual ones, or all that can be one. Raises ConfigError, DataDamaged."""
    able = [name for name in columns.names if name not in reserved]
    minus = [name for name in features if name.startswith("-") and name not in columns.cells]
    left_out = _with_patterns([name[1:] for name in minus], able)
    for name in left_out:
        columns.column(name, "left out of the features")
    named = _with_patterns([name for name in features if name not in minus], able) or usual
    named = named or _feature_names(columns, {*reserved, *left_out}, identified, notes)
    names = [name for name in named if name not in left_out]
    if not names:
        raise ConfigError(f"{columns.path}: no feature remains without {listed(left_out)}")
    for name in names:
        if name in reserved:
            raise ConfigError(f"{name!r} cannot be a feature: it is the label, the instance or the order")
    table = columns.table([column for name in names for column in columns.columns_of(name)])
    for name in names:
        if name in columns.cells and (why := identified(name)):
            notes.append(f"{name} is used, although its values {why}: it may reveal the labels")
    notes += columns.unknown_values(table.names)
    _note_uninformative_columns(columns.path, table, notes)
    return table


def _with_patterns(given: Sequence[str], names: Sequence[str]) -> list[str]:
    """Return these names, each once, with all that a pattern such as `pad_*` fits in its place."""
    fitting = {text: [text] if text in names else fnmatch.filter(names, text) or [text] for text in given}
    return list(dict.fromkeys(name for text in given for name in fitting[text]))


def _feature_names(
    columns: CsvColumns, reserved: set[str], identified: Callable[[str], str], notes: list[str]
) -> list[str]:
    """Return the columns that are neither reserved nor identifiers. Raises ConfigError, DataDamaged."""
    _refuse_long_form(columns)
    names, blank = [], "have no values"
    if columns.index:
        notes.append(f"not used, because it is the index that pandas wrote: {columns.index}")
    identifiers: dict[str, list[str]] = {}
    for name in columns.names:
        if name in reserved or name == columns.index:
            continue
        unused = blank if columns.is_blank(name) and not columns.units[name] else identified(name)
        if unused:
            identifiers.setdefault(unused, []).append(name)
        else:
            names.append(name)
    for why, identifier in identifiers.items():
        notes.append(
            f"not used, because they {why}: {listed(identifier)} "
            f"(use {option('features', python='columns')} to include them)"
        )
    if nominal := [name for name in names if columns.is_nominal(name)]:
        notes.append(f"nominal, with a feature for each of their values: {listed(nominal)}")
    if blank in identifiers and not names:
        raise DataDamaged(f"{columns.path}: no feature has any value: {listed(identifiers[blank])}")
    if not names:
        unused = "".join(f". {note}" for note in notes if note.startswith("not used"))
        raise ConfigError(
            f"{columns.path} has no column to learn from besides {', '.join(sorted(reserved))}{unused}"
        )
    return names


def _note_uninformative_columns(path: Path, table: FeatureTable, notes: list[str]) -> None:
    """Note which features have no value or a single value. Raises DataDamaged if none has any."""
    given = {
        name: column[~np.isnan(column)] for name, column in zip(table.names, table.values.T, strict=True)
    }
    blank = [name for name, values in given.items() if not len(values)]
    same = {name: values for name, values in given.items() if len(values) and _span(values) == 0.0}
    constant = [name for name, values in same.items() if values.any() or not splits_of(name)]
    if blank:
        notes.append(f"without any value: {listed(blank)}")
    if constant:
        notes.append(f"constant, and so without information: {listed(constant)}")
    share = float(np.isnan(table.values).mean())
    if share > 0.0:
        notes.append(f"{100 * share:.1f} % of all values are missing")
    if len(blank) == len(table.names):
        raise DataDamaged(f"{path}: no feature has any value: {listed(blank)}")


def _span(values: Numbers) -> float:
    """Return the difference of the largest and the smallest value; infinite where it is too large for a number."""
    return float(values.max()) - float(values.min())
