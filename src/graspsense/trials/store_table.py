"""The labelled trials of a store as a table of features: what `train`, `predict` and `evaluate` take.

The features are those that were drawn when the trials were kept. Trials that are not whole, were set aside, or did
not end by themselves are left out.
"""

from __future__ import annotations

import json
import tomllib
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.features import FeatureTable
from graspsense.core.labelled import Control, Labelled
from graspsense.trials.before_contact import SPAN_S
from graspsense.trials.provenance import recipe
from graspsense.trials.store import COUNTS, Store

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
    with Store.read(folder) as store:
        rows = store.query(
            f"""SELECT id, label, instance, simulated, recipe, feature_set, "values", before_set, before
            FROM trial WHERE {COUNTS} AND label IS NOT NULL ORDER BY id"""
        )
        if not rows:
            raise ConfigError(
                f"the store in {folder} has no labelled trial that ended by itself: `graspsense collect --save "
                f"{folder} --labels ...` makes them"
            )
        sets = dict(store.query("SELECT id, features FROM feature_set"))
        newest = store.trial(rows[-1][0])
    columns = list(zip(*rows, strict=True))
    notes = ["features as they were drawn when the trials were kept"]
    chosen = columns[5][-1]
    if len(set(columns[5])) > 1:
        notes.append(
            f"{sum(one != chosen for one in columns[5])} trials left out: they have other features than the newest"
        )
        columns = list(zip(*(row for row in rows if row[5] == chosen), strict=True))
    numbers, labels, instances, simulated, recipes, _, values, before_sets, before = columns
    table = _table(folder, sets[chosen], values)
    if len(set(recipes)) > 1:
        notes.append(
            f"recorded with {len(set(recipes))} different settings of gripper, controller or features"
        )
    kinds = Counter(simulated)
    if kinds[1]:
        share = "all" if not kinds[0] else f"{kinds[1]} of {len(simulated)}"
        notes.append(f"simulated: {share} trials come from a model of gripper and objects")
    unnamed = sum(one is None for one in instances)
    one_before = len(set(before_sets)) == 1
    has_width = "p_first" in table.names
    return Labelled(
        source=f"store:{folder}",
        table=table,
        labels=tuple(labels),
        instances=None if unnamed else tuple(instances),
        no_instances=f"{unnamed} trials do not name the very thing (can:full_open#2)",
        order=tuple(numbers),
        before_contact=Control(
            table=_table(folder, sets[before_sets[0]], before),
            what=f"the first {SPAN_S:g} s of the approach: gap, speed, effort, pad forces",
        )
        if one_before
        else None,
        no_before_contact="the trials do not have the same features from before the contact",
        width=Control(table=table.columns(["p_first"]), what="p_first alone") if has_width else None,
        no_width="there is no feature p_first",
        notes=tuple(notes),
        provenance={
            "simulated": bool(kinds[1]),
            "store": str(folder),
            "newest_trial": numbers[-1],
            "settings": recipe(tomllib.loads(newest.settings)),
            "components": newest.provenance.get("components", {}),
        },
    )


def feature_table(
    folder: str, wanted: Sequence[tuple[str, str]], sets: Sequence[str], values: Sequence[str]
) -> FeatureTable:
    """Return the table of these features of trials that may have different ones; NaN where a trial has it not.

    `sets` are the JSON of each trial's own features, `values` of its numbers. Raises DataDamaged.
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


def _table(folder: str, features: str, values: Sequence[str]) -> FeatureTable:
    """Return the table of JSON lists of numbers, null where missing."""
    try:
        named = [(str(name), str(unit)) for name, unit in json.loads(features)]
        rows = json.loads(f"[{','.join(values)}]")
        numbers: NDArray[np.float64] = np.array(rows, dtype=np.float64)
        if numbers.size == 0:
            numbers = numbers.reshape(len(values), len(named))
        if numbers.shape != (len(values), len(named)):
            raise ValueError(f"{numbers.shape} numbers for {len(values)} trials with {len(named)} features")
    except (ValueError, TypeError) as error:
        raise DataDamaged(
            f"the features in the store in {folder} are damaged ({error}): graspsense verify {folder}"
        ) from error
    return FeatureTable(
        names=tuple(name for name, _ in named), units=tuple(unit for _, unit in named), values=numbers
    )
