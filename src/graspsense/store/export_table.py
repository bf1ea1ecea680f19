"""Exporting the trials of a store as one table: CSV, ARFF, NPZ or Parquet."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.errors import ConfigError
from graspsense.recording.atomic_file import write_new
from graspsense.recording.parquet import parquet
from graspsense.store.dataset import feature_table
from graspsense.store.store import Store

if TYPE_CHECKING:
    from graspsense.core.features import FeatureTable

ABOUT: Final = (
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


@frozen(kw_only=True, eq=False)
class TrialTable:
    """The trials of a store: descriptive columns (`about`), and the features."""

    about: Mapping[str, list[Any]]
    features: FeatureTable
    set_aside: int = 0
    """Number of trials of the store that are not in the table, because they are set aside."""


def trial_table(folder: str | Path) -> TrialTable:
    """Return all trials of a store that are not set aside. Raises ConfigError if there is none, DataDamaged."""
    with Store.read(folder) as store:
        rows = store.query(
            """SELECT id, made_at, label, instance, outcome, origin, device, simulated, recording, feature_set, "values"
            FROM trial WHERE set_aside IS NULL ORDER BY id"""
        )
        sets = dict(store.query("SELECT id, features FROM feature_set"))
        ((set_aside,),) = store.query("SELECT count(*) FROM trial WHERE set_aside IS NOT NULL")
    if not rows:
        aside = f" that is not set aside ({set_aside} are)" if set_aside else ""
        raise ConfigError(f"the store in {folder} has no trial to export{aside}")
    columns = list(zip(*rows, strict=True))
    names: dict[tuple[str, str], None] = {}
    for number in dict.fromkeys(columns[-2]):
        names.update(dict.fromkeys((str(name), str(unit)) for name, unit in json.loads(sets[number])))
    table = feature_table(str(folder), list(names), [sets[number] for number in columns[-2]], columns[-1])
    return TrialTable(
        about={name: list(column) for name, column in zip(ABOUT, columns[: len(ABOUT)], strict=True)},
        features=table,
        set_aside=set_aside,
    )


def write_csv(path: Path, table: TrialTable) -> None:
    """Write one line per trial; headings give units, as in `p_first [m]`, and a missing value is an empty cell."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    features = table.features
    headings = [f"{name} [{unit}]" for name, unit in zip(features.names, features.units, strict=True)]
    writer.writerow([*table.about, *headings])
    for about, values in zip(zip(*table.about.values(), strict=True), features.values.tolist(), strict=True):
        cells = ["" if math.isnan(value) else repr(value) for value in values]
        writer.writerow([*("" if cell is None else cell for cell in about), *cells])
    write_new(path, out.getvalue().encode())


def write_arff(path: Path, table: TrialTable) -> None:
    """Write an ARFF file for Weka: the features (`?` for a missing value), and the label as the last attribute."""
    labels = table.about["label"]
    classes = sorted({label for label in labels if label is not None})
    if not classes:
        raise ConfigError("an ARFF file needs a class attribute, and no trial has a label")
    lines = ["@relation graspsense", ""]
    features = table.features
    for name, unit in zip(features.names, features.units, strict=True):
        lines.append(f"% {name} in {unit}" if unit else f"% {name}")
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
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
