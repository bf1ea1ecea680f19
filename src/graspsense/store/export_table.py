"""The trials of a store as one table: CSV, ARFF, NPZ, Parquet."""

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
from graspsense.recording.atomic_file import write_whole
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
    """What is known of each trial, as columns of text and numbers, beside its features."""

    about: Mapping[str, list[Any]]
    features: FeatureTable


def trial_table(folder: str | Path) -> TrialTable:
    """Return all trials of a store that were not set aside. Raises ConfigError where there is none, DataDamaged."""
    with Store.read(folder) as store:
        rows = store.query(
            """SELECT id, made_at, label, instance, outcome, origin, device, simulated, recording, feature_set, "values"
            FROM trial WHERE set_aside IS NULL ORDER BY id"""
        )
        sets = dict(store.query("SELECT id, features FROM feature_set"))
    if not rows:
        raise ConfigError(f"the store in {folder} has no trial to export")
    columns = list(zip(*rows, strict=True))
    names: dict[tuple[str, str], None] = {}
    for number in dict.fromkeys(columns[-2]):
        names.update(dict.fromkeys((str(name), str(unit)) for name, unit in json.loads(sets[number])))
    table = feature_table(str(folder), list(names), [sets[one] for one in columns[-2]], columns[-1])
    return TrialTable(
        about={name: list(column) for name, column in zip(ABOUT, columns[: len(ABOUT)], strict=True)},
        features=table,
    )


def write_csv(path: Path, table: TrialTable) -> None:
    """Write a line a trial, the unit behind each feature: `p_first [m]`; empty where missing."""
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    features = table.features
    headings = [f"{name} [{unit}]" for name, unit in zip(features.names, features.units, strict=True)]
    writer.writerow([*table.about, *headings])
    for about, values in zip(zip(*table.about.values(), strict=True), features.values.tolist(), strict=True):
        cells = ["" if math.isnan(value) else repr(value) for value in values]
        writer.writerow([*("" if one is None else one for one in about), *cells])
    write_whole(path, out.getvalue().encode())


def write_arff(path: Path, table: TrialTable) -> None:
    """Write an ARFF for Weka: the features, `?` where missing, and the label as the nominal class, last."""
    labels = table.about["label"]
    classes = sorted({one for one in labels if one is not None})
    if not classes:
        raise ConfigError("ARFF needs a class, and no trial has a label")
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
    write_whole(path, ("\n".join(lines) + "\n").encode())


def write_npz(path: Path, table: TrialTable) -> None:
    """Write arrays: `values` of shape (trials, features), `features`, `units`, and a column of each other thing."""
    out = io.BytesIO()
    features = table.features
    about = {
        name: np.array([("" if one is None else one) for one in column])
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
    write_whole(path, out.getvalue())


def write_parquet(path: Path, table: TrialTable) -> None:
    """Write a Parquet file; the units stand in the fields' metadata. Raises PluginUnavailable without pyarrow."""
    features = table.features
    columns: dict[str, tuple[Any, str]] = {name: (column, "") for name, column in table.about.items()}
    for k, (name, unit) in enumerate(zip(features.names, features.units, strict=True)):
        values = [None if math.isnan(value) else value for value in features.values[:, k].tolist()]
        columns[name] = (values, unit)
    write_whole(path, parquet(columns))


WRITERS: Final[Mapping[str, Callable[[Path, TrialTable], None]]] = {
    ".csv": write_csv,
    ".arff": write_arff,
    ".npz": write_npz,
    ".parquet": write_parquet,
}
"""Ending of a file to what writes it."""


def _arff_word(text: str) -> str:
    if text.isascii() and text.replace("_", "a").isalnum():
        return text
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"
