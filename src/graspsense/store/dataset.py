"""The labelled trials of a store as a table of features: what `train`, `predict` and `evaluate` take.

The features are those that were drawn when the trials were kept. Trials that are not whole, were set aside, or did
not end by themselves are left out.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.features import FeatureTable
from graspsense.core.labelled import Control, Labelled
from graspsense.recording.before_contact import SPAN_S
from graspsense.recording.provenance import recipe
from graspsense.store.store import COUNTS, Store

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.roles import FeatureSet


def read_dataset(folder: str, features: FeatureSet[Any], *, unreliable: bool = False) -> Labelled:
    """Return the labelled trials of the store in this folder; the data set `store:FOLDER`.

    Raises ConfigError where there is no store, no labelled trial, or other features are asked for; DataDamaged.
    """
    del unreliable
    if features.config != type(features.config)():
        raise ConfigError(
            "a store holds the features that were drawn when its trials were kept: options for [features] have no "
            "effect on them. Leave them out; `graspsense replay` draws others from a recording"
        )
    return labelled_store(folder)


def labelled_store(folder: str) -> Labelled:
    """Return the labelled trials of the store in this folder. Raises ConfigError, DataDamaged."""
    counting = f"FROM trial WHERE {COUNTS} AND label IS NOT NULL"
    with Store.read(folder) as store:
        newest_ones = store.query(f"SELECT id, feature_set {counting} ORDER BY id DESC LIMIT 1")
        if not newest_ones:
            raise ConfigError(
                f"the store in {folder} has no labelled trial that ended by itself: `graspsense collect --save "
                f"{folder} --labels ...` makes them"
            )
        ((number, chosen),) = newest_ones
        newest = store.trial(number)
        sets = dict(store.query("SELECT id, features FROM feature_set"))
        rows = store.query(
            f"""SELECT id, label, instance, "values", before, before_set, simulated, recipe {counting}
            AND feature_set = ? ORDER BY id""",
            (chosen,),
        )
        ((every,),) = store.query(f"SELECT count(*) {counting}")
    numbers, labels, instances, values, before, of_before, models, settings = zip(*rows, strict=True)
    table = _table(folder, sets[chosen], values)
    notes = ["features as they were drawn when the trials were kept"]
    if every != len(rows):
        notes.append(f"{every - len(rows)} trials left out: they have other features than the newest")
    recipes = len(set(settings))
    if recipes > 1:
        notes.append(f"recorded with {recipes} different settings of gripper, controller or features")
    simulated = sum(models)
    if simulated:
        share = "all" if simulated == len(rows) else f"{simulated} of {len(rows)}"
        notes.append(f"simulated: {share} trials come from a model of gripper and objects")
    before_sets = set(of_before)
    unnamed = sum(one is None for one in instances)
    has_width = "p_first" in table.names
    return Labelled(
        source=f"store:{folder}",
        table=table,
        labels=labels,
        instances=None if unnamed else instances,
        no_instances=f"{unnamed} trials do not name the very thing (can:full_open#2)",
        order=numbers,
        before_contact=Control(
            table=_table(folder, sets[min(before_sets)], before),
            what=f"the first {SPAN_S:g} s of the approach: gap, speed, effort, pad forces",
        )
        if len(before_sets) == 1
        else None,
        no_before_contact="the trials do not have the same features from before the contact",
        width=Control(table=table.columns(["p_first"]), what="p_first alone") if has_width else None,
        no_width="there is no feature p_first",
        notes=tuple(notes),
        provenance={
            "simulated": bool(simulated),
            "store": str(folder),
            "newest_trial": number,
            "settings": recipe(tomllib.loads(newest.settings)),
            "components": newest.provenance.get("components", {}),
        },
    )


def feature_table(
    folder: str, wanted: Sequence[tuple[str, str]], sets: Sequence[str], values: Sequence[bytes]
) -> FeatureTable:
    """Return the table of these features of trials that may have different ones; NaN where a trial has it not.

    `sets` are the JSON of each trial's own features, `values` its numbers as they are stored. Raises DataDamaged.
    """
    numbers = np.full((len(values), len(wanted)), np.nan)
    kinds = np.array(sets)
    for kind in dict.fromkeys(sets):
        rows = np.flatnonzero(kinds == kind)
        some = _table(folder, kind, [values[k] for k in rows.tolist()])
        for k, pair in enumerate(zip(some.names, some.units, strict=True)):
            if pair in wanted:
                numbers[rows, wanted.index(pair)] = some.values[:, k]
    return FeatureTable(
        names=tuple(name for name, _ in wanted), units=tuple(unit for _, unit in wanted), values=numbers
    )


def _table(folder: str, features: str, values: Sequence[bytes]) -> FeatureTable:
    """Return the table of packed numbers."""
    try:
        named = [(str(name), str(unit)) for name, unit in json.loads(features)]
        numbers: NDArray[np.float64] = np.frombuffer(b"".join(values), dtype="<f8").astype(np.float64)
        numbers = numbers.reshape(len(values), len(named))
        if set(map(len, values)) != {8 * len(named)} or np.isinf(numbers).any():
            raise ValueError("numbers are missing, or infinite")
    except (ValueError, TypeError) as error:
        raise DataDamaged(
            f"the features in the store in {folder} are damaged ({error}): graspsense verify {folder}"
        ) from error
    return FeatureTable(
        names=tuple(name for name, _ in named), units=tuple(unit for _, unit in named), values=numbers
    )
