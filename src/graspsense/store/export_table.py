"""Exporting the trials of a store as one table: CSV, ARFF, NPZ or Parquet."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.core.files.csv_text import csv_text
from graspsense.core.files.whole_file import write_new
from graspsense.core.learn.target_value import RESERVED, name_and_unit
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.printable import in_one_line
from graspsense.core.values.written_numbers import number_in
from graspsense.recording.parquet import parquet
from graspsense.store.changes import with_changed_numbers
from graspsense.store.dataset import unpacked_table
from graspsense.store.first_line import first_lines
from graspsense.store.opening import decoded
from graspsense.store.store import Store
from graspsense.store.time_recorded import ORDER, RECORDED_AT

ABOUT: Final = (
    "trial",
    "made_at",
    "recorded_at",
    "order",
    "label",
    "instance",
    "outcome",
    "complete",
    "origin",
    "device",
    "simulated",
    "recording",
    "feature_set",
)
"""Columns that describe a trial. `recorded_at` and `order` are those of an import that names them."""
ABOUT_BEFORE: Final = (
    "trial",
    "made_at",
    "label",
    "instance",
    "outcome",
    "origin",
    "device",
    "simulated",
    "recording",
)
"""The columns that describe a trial in the tables of earlier versions."""
BEFORE, FIRST, VALUE = "before_contact.", "first_line.", "value."
"""What the name of a column of a CSV file begins with that holds a number of a control, or one to predict."""


@frozen(kw_only=True, eq=False)
class TrialTable:
    """The trials of a store: descriptive columns (`about`), and the features."""

    about: Mapping[str, list[Any]]
    features: FeatureTable
    further: FeatureTable
    """The numbers of the controls and those to predict, whose names begin with `BEFORE`, `FIRST` or `VALUE`."""
    set_aside: int = 0
    """Number of trials of the store that are not in the table, because they are set aside."""


def trial_table(folder: str | Path) -> TrialTable:
    """Return all trials of a store that are not set aside. Raises ConfigError if there is none, DataDamaged."""
    with Store.read(folder) as store:
        ((set_aside,),) = store.query("SELECT count(*) FROM trial WHERE set_aside IS NOT NULL")
        stored = ("id", "made_at", "labels", *ABOUT[ABOUT.index("label") :])
        columns = store.columns((*stored, "values", "before_set", "before_contact"), "set_aside IS NULL")
        columns["trial"] = columns.pop("id")
        if not columns["trial"]:
            aside = f" that is not set aside ({set_aside} are)" if set_aside else ""
            raise ConfigError(f"the store in {folder} has no trial to export{aside}")
        sets = dict(store.query("SELECT id, features FROM feature_set"))
        first_line = first_lines(store, columns["recording"], columns["origin"])
        labels = [decoded(folder, text) for text in columns["labels"]]
        numbers = with_changed_numbers(store, columns["trial"], labels)
    columns |= {name: tuple(label.get(name) for label in labels) for name in (RECORDED_AT, ORDER)}
    opening = _unpacked(folder, sets, columns["before_set"], columns["before_contact"])
    parts = [(BEFORE, opening), (FIRST, first_line), (VALUE, _numbers_to_predict(numbers))]
    return TrialTable(
        about={name: list(columns[name]) for name in ABOUT},
        features=_unpacked(folder, sets, columns["feature_set"], columns["values"]),
        further=_side_by_side([(prefix, part) for prefix, part in parts if part is not None]),
        set_aside=set_aside,
    )


def _unpacked(
    folder: str | Path, sets: Mapping[int, str], numbers: Sequence[int], values: Sequence[bytes]
) -> FeatureTable:
    """Return packed values of several feature sets as a table of all their features; a missing feature is NaN."""
    columns: dict[tuple[str, str], NDArray[np.float64]] = {}
    set_of_trial = np.array(numbers)
    for number in dict.fromkeys(numbers):
        rows = np.flatnonzero(set_of_trial == number)
        part = unpacked_table(str(folder), sets[number], [values[k] for k in rows.tolist()])
        for k, pair in enumerate(zip(part.names, part.units, strict=True)):
            columns.setdefault(pair, np.full(len(values), np.nan))[rows] = part.values[:, k]
    return FeatureTable(
        names=tuple(name for name, _ in columns),
        units=tuple(unit for _, unit in columns),
        values=np.stack(list(columns.values()), axis=1) if columns else np.empty((len(values), 0)),
    )


def _numbers_to_predict(labels: Sequence[Mapping[str, str]]) -> FeatureTable:
    """Return the numbers among the labels of the trials, NaN where a trial does not have one."""
    headings = {
        heading: name_and_unit(heading)
        for label in labels
        for heading, cell in label.items()
        if name_and_unit(heading)[0] not in RESERVED and number_in(cell) is not None
    }
    values = np.full((len(labels), len(headings)), np.nan)
    for row, label in enumerate(labels):
        for k, heading in enumerate(headings):
            number = number_in(label.get(heading, ""))
            values[row, k] = np.nan if number is None else number
    return FeatureTable(
        names=tuple(name for name, _ in headings.values()),
        units=tuple(unit for _, unit in headings.values()),
        values=values,
    )


def _side_by_side(parts: Sequence[tuple[str, FeatureTable]]) -> FeatureTable:
    """Return tables of the same trials as one, with a prefix before the names of each."""
    return FeatureTable(
        names=tuple(f"{prefix}{name}" for prefix, part in parts for name in part.names),
        units=tuple(unit for _, part in parts for unit in part.units),
        values=np.hstack([part.values for _, part in parts]),
    )


def write_csv(path: Path, table: TrialTable) -> None:
    """Write one line per trial; headings give units, as in `p_first [m]`, and a missing value is an empty cell.

    The numbers of the controls follow the features, so that `evaluate` of the file is that of the store.
    """
    features = _side_by_side([("", table.features), ("", table.further)])
    headings = [f"{name} [{unit}]" for name, unit in zip(features.names, features.units, strict=True)]
    about = zip(*table.about.values(), strict=True)
    rows = [[*cells, *values] for cells, values in zip(about, features.values.tolist(), strict=True)]
    write_new(path, csv_text([[*table.about, *headings], *rows]).encode())


def write_arff(path: Path, table: TrialTable) -> None:
    """Write an ARFF file for Weka: the features (`?` for a missing value), and the label as the last attribute."""
    labels = table.about["label"]
    classes = sorted({label for label in labels if label is not None})
    if not classes:
        raise ConfigError("an ARFF file needs a class attribute, and no trial has a label")
    lines = ["@relation graspsense", ""]
    features = table.features
    for name, unit in zip(features.names, features.units, strict=True):
        lines.append(in_one_line(f"% {name} in {unit}" if unit else f"% {name}"))
        lines.append(f"@attribute {_arff_word(name)} numeric")
    lines.append(f"@attribute label {{{','.join(map(_arff_word, classes))}}}")
    lines += ["", "@data"]
    for label, values in zip(labels, features.values.tolist(), strict=True):
        cells = ["?" if math.isnan(value) else repr(value) for value in values]
        lines.append(",".join([*cells, "?" if label is None else _arff_word(label)]))
    write_new(path, ("\n".join(lines) + "\n").encode())


def write_npz(path: Path, table: TrialTable) -> None:
    """Write arrays: `values` of shape (trials, features), `features`, `units`, and one array per column of `about`."""
    out = io.BytesIO()
    features = table.features
    about = {
        name: np.array([("" if cell is None else cell) for cell in column])
        for name, column in table.about.items()
    }
    np.savez_compressed(
        out,
        allow_pickle=False,
        values=features.values,
        features=np.array(features.names),
        units=np.array(features.units),
        **about,
    )
    write_new(path, out.getvalue())


def write_parquet(path: Path, table: TrialTable) -> None:
    """Write a Parquet file with units in the metadata of its fields. Raises PluginUnavailable without pyarrow."""
    features = table.features
    columns: dict[str, tuple[Any, str]] = {name: (column, "") for name, column in table.about.items()}
    for k, (name, unit) in enumerate(zip(features.names, features.units, strict=True)):
        values = [None if math.isnan(value) else value for value in features.values[:, k].tolist()]
        columns[name] = (values, unit)
    write_new(path, parquet(columns))


WRITERS: Final[Mapping[str, Callable[[Path, TrialTable], None]]] = {
    ".csv": write_csv,
    ".arff": write_arff,
    ".npz": write_npz,
    ".parquet": write_parquet,
}
"""File extension to the function that writes it."""


def _arff_word(text: str) -> str:
    if text.isascii() and text.replace("_", "a").isalnum():
        return text
    escaped = text.replace("\\", "\\\\").replace("'", "\\'")
    # A line of an ARFF file ends at a line feed, also within quotes.
    return "'" + escaped.replace("\n", "\\n").replace("\r", "\\r").replace("\t", "\\t") + "'"
