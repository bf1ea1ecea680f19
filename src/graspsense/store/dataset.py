"""The labelled trials of a store as a table of features, for `train`, `predict` and `evaluate`.

The features are those that were extracted when the trials were recorded. Trials that are incomplete, were set aside,
or did not end by themselves are left out.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.features import FeatureTable
from graspsense.core.labelled import Labelled
from graspsense.recording.controls import controls
from graspsense.store.first_line import first_lines
from graspsense.store.store import COUNTS, Store
from graspsense.store.time_recorded import order_recorded

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.roles import FeatureSet


def read_dataset(folder: str, features: FeatureSet[Any], *, unreliable: bool = False) -> Labelled:
    """Return the labelled trials of the store in this folder; the data set `store:FOLDER`.

    Raises ConfigError if there is no store or no labelled trial, or if `features` has other than default settings;
    DataDamaged.
    """
    del unreliable
    if features.config != type(features.config)():
        raise ConfigError(
            "a store holds the features that were extracted when its trials were recorded, so options for [features] "
            "have no effect. Leave them out, or extract other features from a recording with `graspsense replay`"
        )
    return labelled_store(folder)


def labelled_store(folder: str) -> Labelled:
    """Return the labelled trials of the store in this folder that have the feature set of the newest one.

    Raises ConfigError if there is no store or no labelled trial, DataDamaged.
    """
    counting = f"FROM trial WHERE {COUNTS} AND label IS NOT NULL"
    with Store.read(folder) as store:
        newest_row = store.query(f"SELECT id, feature_set {counting} ORDER BY id DESC LIMIT 1")
        if not newest_row:
            raise ConfigError(
                f"the store in {folder} has no labelled trial that ended by itself. Record some with `graspsense "
                f"collect --save {folder} --labels ...`"
            )
        ((newest_number, feature_set),) = newest_row
        newest = store.trial(newest_number)
        sets = dict(store.query("SELECT id, features FROM feature_set"))
        rows = store.query(
            f"""SELECT label, instance, "values", before_contact, before_set, simulated, recipe, made_at, origin,
            recording, detail.labels, missing_before FROM trial JOIN detail ON detail.trial = trial.id
            WHERE {COUNTS} AND label IS NOT NULL AND feature_set = ? ORDER BY id""",
            (feature_set,),
        )
        columns = list(zip(*rows, strict=True))
        labels, instances, values, before, before_sets, simulated, recipes = columns[:7]
        made_at, origins, recordings, texts, missing_before = columns[7:]
        first_line = first_lines(store, recordings, origins)
        ((total,),) = store.query(f"SELECT count(*) {counting}")
        unused = _unused(store)
    table = _unpacked_table(folder, sets[feature_set], values)
    same_before = len(set(before_sets)) == 1
    order, no_order = order_recorded(made_at, origins, texts)
    unnamed = sum(instance is None for instance in instances)
    return Labelled(
        source=f"store:{folder}",
        table=table,
        labels=labels,
        instances=None if unnamed else instances,
        no_instances=f"{unnamed} trials do not name the individual object (can:full_open#2)",
        order=order,
        no_order=no_order,
        **controls(
            table,
            _unpacked_table(folder, sets[before_sets[0]], before) if same_before else None,
            no_before="the trials do not have the same features from before contact",
            before_missing=_most_frequent_reason(missing_before),
            first_line=first_line,
        ),
        notes=tuple(_notes(len(rows), total, len(set(recipes)), sum(simulated))) + unused,
        provenance={
            "simulated": any(simulated),
            "store": str(folder),
            "newest_trial": newest_number,
            "settings": newest.recipe,
            "components": newest.record.provenance.get("components", {}),
        },
    )


def _most_frequent_reason(missing: Sequence[str]) -> str:
    """Return the most frequent of the reasons why features are missing, given those of each trial as JSON."""
    reasons: Counter[str] = Counter()
    for text in missing:
        with suppress(ValueError, AttributeError, TypeError):
            reasons.update(set(json.loads(text).values()))
    return reasons.most_common(1)[0][0] if reasons else ""


def _unused(store: Store) -> tuple[str, ...]:
    """Return a note on the trials that are not learned from, and one on those whose labels were changed."""
    ((aside, aborted, unlabelled, relabelled),) = store.query(
        f"""SELECT sum(set_aside IS NOT NULL), sum(set_aside IS NULL AND NOT ({COUNTS})),
            sum({COUNTS} AND label IS NULL),
            sum({COUNTS} AND id IN (SELECT trial FROM change WHERE "action" = 'relabel')) FROM trial"""
    )
    reasons = {"set aside": aside, "aborted or incomplete": aborted, "without a label": unlabelled}
    notes = []
    if any(reasons.values()):
        text = ", ".join(f"{n} {reason}" for reason, n in reasons.items() if n)
        notes.append(f"trials of the store that are not used: {text}")
    if relabelled:
        notes.append(
            f"the labels of {relabelled} trials were changed after recording: graspsense trials history"
        )
    return tuple(notes)


def _notes(used: int, total: int, recipes: int, simulated: int) -> list[str]:
    notes = ["the features are those extracted when the trials were recorded"]
    if total != used:
        notes.append(
            f"{total - used} trials are left out: their features differ from those of the newest trial"
        )
    if recipes > 1:
        notes.append(
            f"the trials were recorded with {recipes} different settings of gripper, controller or features"
        )
    if simulated:
        share = "all" if simulated == used else f"{simulated} of {used}"
        notes.append(f"{share} trials are simulated")
    return notes


def feature_table(
    folder: str, wanted: Sequence[tuple[str, str]], sets: Sequence[str], values: Sequence[bytes]
) -> FeatureTable:
    """Return the table of these features for trials with different feature sets; a missing feature is NaN.

    `sets` holds the feature names of each trial as JSON, `values` its packed values. Raises DataDamaged.
    """
    numbers = np.full((len(values), len(wanted)), np.nan)
    set_of_trial = np.array(sets)
    for names_text in dict.fromkeys(sets):
        rows = np.flatnonzero(set_of_trial == names_text)
        part = _unpacked_table(folder, names_text, [values[k] for k in rows.tolist()])
        for k, pair in enumerate(zip(part.names, part.units, strict=True)):
            if pair in wanted:
                numbers[rows, wanted.index(pair)] = part.values[:, k]
    return FeatureTable(
        names=tuple(name for name, _ in wanted), units=tuple(unit for _, unit in wanted), values=numbers
    )


def _unpacked_table(folder: str, names_text: str, values: Sequence[bytes]) -> FeatureTable:
    """Return the table of packed values, one item per trial. Raises DataDamaged."""
    try:
        pairs = [(str(name), str(unit)) for name, unit in json.loads(names_text)]
        numbers: NDArray[np.float64] = np.frombuffer(b"".join(values), dtype="<f8").astype(np.float64)
        numbers = numbers.reshape(len(values), len(pairs))
        if set(map(len, values)) != {8 * len(pairs)} or np.isinf(numbers).any():
            raise ValueError("numbers are missing, or infinite")
    except (ValueError, TypeError) as error:
        raise DataDamaged(
            f"the features in the store in {folder} are damaged ({error}): graspsense verify {folder}"
        ) from error
    return FeatureTable(
        names=tuple(name for name, _ in pairs), units=tuple(unit for _, unit in pairs), values=numbers
    )
