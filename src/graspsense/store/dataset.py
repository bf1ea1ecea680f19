"""The labelled trials of a store as a table of features, for `train`, `predict` and `evaluate`.

The features are those that were extracted when the trials were recorded, or, with other settings, those that are
extracted again from the recordings. Trials that are incomplete, were set aside, or did not end by themselves are left
out.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import datetime
from typing import Any, Final

import numpy as np
from attrs import evolve, fields_dict, frozen
from numpy.typing import NDArray

from graspsense.core.components.roles import FeatureSet
from graspsense.core.components.strict import plain
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.target_value import TargetValue, values_of_labels
from graspsense.core.settings.layers import Flag
from graspsense.core.values.errors import ConfigError, DataDamaged, counted
from graspsense.core.values.features import FeatureTable, table_of
from graspsense.recording.controls import Controls, controls, without_constant_gap
from graspsense.recording.provenance import recipe
from graspsense.recording.readable import note_on, readable
from graspsense.recording.reader import read_recorded
from graspsense.recording.replayable import curve_bytes, grasp_numbers
from graspsense.store.changes import with_changed_numbers
from graspsense.store.extract_again import ExtractedTrials, extract_again
from graspsense.store.first_line import first_lines, imported_gaps
from graspsense.store.opening import decoded
from graspsense.store.rows import StoredTrial
from graspsense.store.store import COUNTS, Store
from graspsense.store.time_recorded import order_recorded

Progress = Callable[[int, int], None]


def read_dataset(folder: str, features: FeatureSet[Any], *, unreliable: bool = False) -> Labelled:
    """Return the labelled trials of the store in this folder; the data set `store:FOLDER`.

    The features are extracted again if `features` has other than default settings. Raises ConfigError if there is no
    store or no labelled trial, DataDamaged.
    """
    del unreliable
    default, given = plain(type(features.config)()), plain(features.config)
    changed = {key: value for key, value in given.items() if value != default[key]}
    flags = [Flag("features", f"features.{key}", value) for key, value in changed.items()]
    return labelled_store(folder, flags=flags)


@frozen(kw_only=True)
class _Rows:
    """The columns of the trials that are used, one item per trial in each."""

    id: tuple[int, ...]
    label: tuple[str | None, ...]
    instance: tuple[str | None, ...]
    values: tuple[bytes, ...]
    before_contact: tuple[bytes, ...]
    before_set: tuple[int, ...]
    feature_set: tuple[int, ...]
    simulated: tuple[int, ...]
    recipe: tuple[str, ...]
    made_at: tuple[str, ...]
    origin: tuple[str, ...]
    recording: tuple[str, ...]
    outcome: tuple[str, ...]
    labels: tuple[str, ...]
    missing: tuple[str, ...]
    missing_before: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.id)

    def picked(self, rows: Sequence[int]) -> _Rows:
        """Return these rows."""
        return _Rows(**{name: tuple(getattr(self, name)[i] for i in rows) for name in _COLUMNS})


_COLUMNS: Final = tuple(fields_dict(_Rows))


def labelled_store(
    folder: str,
    options: Sequence[str] = (),
    *,
    flags: Sequence[Flag] = (),
    value: str | None = None,
    checkpoints_s: Sequence[float] = (),
    progress: Progress | None = None,
) -> Labelled:
    """Return the labelled trials of the store in this folder that have the feature set of the newest one.

    With `options` as after `-o`, `flags` or `checkpoints_s`, the features of all labelled trials are extracted again
    with these settings, and at these times after the contact as well. With `value`, the trials are those that have this
    number among their labels, and it is the target. Raises ConfigError if there is no such trial, DataDamaged.
    """
    wanted = COUNTS if value is not None else f"{COUNTS} AND label IS NOT NULL"
    with Store.read(folder) as store:
        newest, feature_set = _newest(store, wanted)
        changed = (*options, *(flag.key for flag in flags), *(f"checkpoint {t:g} s" for t in checkpoints_s))
        same_set = "" if changed else f" AND feature_set = {feature_set}"
        rows = _Rows(**store.columns(_COLUMNS, wanted + same_set))
        target, notes = None, [] if changed else _of_recording(store, wanted, len(rows))
        rows = _intact(store, rows, notes)
        if value is not None:
            rows, target = _with_value(store, rows, value, notes)
        settings, components = newest.recipe, newest.record.provenance.get("components", {})
        if changed:
            extracted = extract_again(
                store, rows.id, options, flags=flags, checkpoints_s=checkpoints_s, progress=progress
            )
            asked = rows.id
            rows, tables = _tables_again(rows, extracted, changed, notes)
            if target is not None:
                known = dict(zip(asked, target.values, strict=True))
                target = evolve(target, values=tuple(known[number] for number in rows.id))
            # The gripper is the one that grasped, not the replay.
            settings = {**recipe(extracted.settings), "gripper": settings.get("gripper", {})}
            components = {**extracted.components, "gripper": components.get("gripper", "")}
        else:
            tables = _stored_tables(store, folder, rows, feature_set)
        known_controls = _controls(store, rows, tables)
        content, unused = _contents(store, rows), _unused(store)
    labels = [decoded(folder, text) for text in rows.labels]
    order, no_order = order_recorded(rows.made_at, rows.origin, labels)
    return Labelled(
        source=f"store:{folder}",
        table=tables.features,
        labels=tuple(label or "" for label in rows.label),
        instances=None if None in rows.instance else tuple(str(instance) for instance in rows.instance),
        no_instances=f"{counted(rows.instance.count(None), 'trial')} that name no individual, as can:full_open#2 does",
        recorded_with={"settings of gripper, controller or features": rows.recipe},
        order=order,
        no_order=no_order,
        content=content,
        **known_controls,
        value=target,
        notes=(*notes, *_notes(len(set(rows.recipe)), sum(rows.simulated), len(rows)), *unused),
        provenance=_provenance(folder, rows, newest.summary.id, settings, components),
    )


def _contents(store: Store, rows: _Rows) -> tuple[str, ...]:
    """Return a text for each trial, equal for those of the same grasp; empty for those that are like no other.

    A recovered copy has the same contact as the recording that was damaged, so that only such recordings are compared.
    """
    alike: dict[tuple[int, bytes], list[int]] = {}
    for i, opening in enumerate(zip(rows.before_set, rows.before_contact, strict=True)):
        alike.setdefault(opening, []).append(i)
    contents = [""] * len(rows)
    for group in alike.values():
        curves: dict[int, bytes] = {}
        for i in group if len(group) > 1 else ():
            with suppress(ConfigError, DataDamaged):
                grasp = read_recorded(store.recording_path(rows.recording[i]), salvage=True)
                curves[i] = curve_bytes(grasp.readings())
        places = list(curves)
        for i, number in zip(places, grasp_numbers(list(curves.values())), strict=True):
            contents[i] = str(rows.id[places[number]])
    return tuple(contents)


def _provenance(
    folder: str, rows: _Rows, newest: int, settings: Mapping[str, Any], components: Mapping[str, str]
) -> dict[str, Any]:
    return {
        "simulated": any(rows.simulated),
        "recorded_too": any(rows.simulated) and not all(rows.simulated),
        "store": str(folder),
        "newest_trial": newest,
        "recipes": len(set(rows.recipe)),
        "settings": settings,
        "components": components,
    }


def _newest(store: Store, wanted: str) -> tuple[StoredTrial, int]:
    """Return the newest wanted trial that can be read, and the number of its feature set.

    Raises ConfigError if there is none, DataDamaged if none can be read.
    """
    feature_sets = dict(store.query(f"SELECT id, feature_set FROM trial WHERE {wanted} ORDER BY id DESC"))
    if not feature_sets:
        raise ConfigError(
            f"the store in {store.folder} has no labelled trial that ended by itself. Record some with `graspsense "
            f"collect --save {store.folder} --labels ...`"
        )
    newest = store.first_readable(feature_sets)
    return newest, int(feature_sets[newest.summary.id])


@frozen(kw_only=True)
class _Tables:
    """The features of the trials, and those from before contact (None if trials differ in their names)."""

    features: FeatureTable
    before_contact: FeatureTable | None


def _controls(store: Store, rows: _Rows, tables: _Tables) -> Controls:
    known_controls = controls(
        tables.features,
        tables.before_contact,
        no_before="the trials do not have the same features from before contact",
        first_line=first_lines(store, rows.recording, rows.origin),
    )
    return without_constant_gap(known_controls, imported_gaps(store, rows.recording, rows.origin))


def _intact(store: Store, rows: _Rows, notes: list[str]) -> _Rows:
    """Return the rows that can be read. Raises the error of the first if none can be."""
    sets = dict(store.query("SELECT id, features FROM feature_set"))
    intact, damage = [], None
    for i, number in enumerate(rows.id):
        try:
            with readable(f"trial {number} of {store.folder}"):
                unpacked_table(str(store.folder), sets[rows.feature_set[i]], rows.values[i : i + 1])
                unpacked_table(str(store.folder), sets[rows.before_set[i]], rows.before_contact[i : i + 1])
                for text in (rows.labels[i], rows.missing[i], rows.missing_before[i]):
                    decoded(store.folder, text)
                datetime.fromisoformat(rows.made_at[i])
            intact.append(i)
        except DataDamaged as error:
            damage = damage or error
    if damage is not None:
        if not intact:
            raise damage
        notes.append(f"{counted(len(rows) - len(intact), 'trial')} left out as damaged: {damage}")
        return rows.picked(intact)
    return rows


def _with_value(store: Store, rows: _Rows, name: str, notes: list[str]) -> tuple[_Rows, TargetValue]:
    """Return the rows that have this number among their labels, and the numbers."""
    recorded = [decoded(store.folder, text) for text in rows.labels]
    labels = with_changed_numbers(store, rows.id, recorded)
    unit, values = values_of_labels(name, labels, f"the store in {store.folder}")
    changed = sum(a != b for a, b in zip(labels, recorded, strict=True))
    if changed:
        notes.append(
            f"numbers of {counted(changed, 'trial')} were changed after recording: graspsense trials history"
        )
    having = [i for i, number in enumerate(values) if number == number]
    if len(having) < len(values):
        notes.append(f"{counted(len(values) - len(having), 'trial')} left out: no {name}")
    target = TargetValue(name=name, unit=unit, values=tuple(values[i] for i in having))
    return rows.picked(having), target


def _stored_tables(store: Store, folder: str, rows: _Rows, feature_set: int) -> _Tables:
    sets = dict(store.query("SELECT id, features FROM feature_set"))
    same_before = len(set(rows.before_set)) == 1
    reasons, before_reasons = (
        {i: decoded(folder, text) for i, text in enumerate(missing) if text != "{}"}
        for missing in (rows.missing, rows.missing_before)
    )
    early = unpacked_table(folder, sets[rows.before_set[0]], rows.before_contact) if same_before else None
    return _Tables(
        features=evolve(unpacked_table(folder, sets[feature_set], rows.values), reasons=reasons),
        before_contact=None if early is None else evolve(early, reasons=before_reasons),
    )


def _tables_again(
    rows: _Rows, extracted: ExtractedTrials, changed: Sequence[str], notes: list[str]
) -> tuple[_Rows, _Tables]:
    """Return the rows and tables of trials that were extracted again, without those that have other features."""
    notes += note_on(extracted.unreadable, len(rows))
    trials = list(extracted.trials.values())
    rows = rows.picked([i for i, number in enumerate(rows.id) if number in extracted.trials])
    headings = [(trial.features.names, trial.features.units) for trial in trials]
    same = [i for i, heading in enumerate(headings) if heading == headings[-1]]
    if len(same) < len(trials):
        notes.append(
            f"{counted(len(trials) - len(same), 'trial')} left out: the features have other names or units than "
            "those of the newest trial"
        )
    notes.append(f"the features were extracted again from the recordings, with {', '.join(changed)}")
    outcomes = Counter(
        f"{rows.outcome[i]} to {trials[i].outcome}" for i in same if rows.outcome[i] != trials[i].outcome
    )
    if outcomes:
        words = ", ".join(f"{n} from {change}" for change, n in outcomes.most_common())
        notes.append(f"outcomes that change with these settings: {words}")
    kept = [trials[i] for i in same]
    early = [trial.before_contact for trial in kept]
    same_before = len({(features.names, features.units) for features in early}) == 1
    return rows.picked(same), _Tables(
        features=table_of(trial.features for trial in kept),
        before_contact=table_of(early) if same_before else None,
    )


def _unused(store: Store) -> tuple[str, ...]:
    """Return a note on the trials that are not learned from, and one on those whose labels were changed."""
    ((aside, aborted, unlabelled, relabelled),) = store.query(
        f"""SELECT sum(set_aside IS NOT NULL), sum(set_aside IS NULL AND NOT ({COUNTS})),
            sum({COUNTS} AND label IS NULL),
            sum({COUNTS} AND id IN (SELECT trial FROM change WHERE "action" = 'relabel')) FROM trial"""
    )
    reasons = {
        "set aside": aside,
        "aborted, ended early or incomplete": aborted,
        "without a label": unlabelled,
    }
    notes = []
    if any(reasons.values()):
        text = ", ".join(f"{n} {reason}" for reason, n in reasons.items() if n)
        notes.append(f"trials of the store that are not used: {text}")
    if relabelled:
        notes.append(
            f"labels of {counted(relabelled, 'trial')} were changed after recording: graspsense trials history"
        )
    return tuple(notes)


def _of_recording(store: Store, wanted: str, used: int) -> list[str]:
    """Return notes on features that were extracted when the trials were recorded."""
    ((total,),) = store.query(f"SELECT count(*) FROM trial WHERE {wanted}")
    notes = ["the features are those extracted when the trials were recorded"]
    if total != used:
        notes.append(
            f"{counted(total - used, 'trial')} left out: other features than those of the newest trial"
        )
    return notes


def _notes(recipes: int, simulated: int, used: int) -> list[str]:
    notes = []
    if recipes > 1:
        notes.append(
            f"the trials were recorded with {recipes} different settings of gripper, controller or features"
        )
    if simulated:
        share = "all" if simulated == used else f"{simulated} of {used}"
        notes.append(f"{share} trials are simulated")
    return notes


def unpacked_table(folder: str, names_text: str, values: Sequence[bytes]) -> FeatureTable:
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
