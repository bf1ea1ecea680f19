"""The recordings of a data set as labelled trials, without a store: `evaluate NAME:FOLDER`.

Features are extracted from the recorded trace. All of it is in the phase `approach`, because no controller of
graspsense was involved.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from attrs import evolve

from graspsense.core.components.roles import FeatureSet
from graspsense.core.learn.checkpoints import with_checkpoints
from graspsense.core.learn.labelled import Labelled, class_of
from graspsense.core.pipeline.wiring import check_recording
from graspsense.core.values.errors import ConfigError, counted
from graspsense.core.values.features import Features, FeatureTable, table_of
from graspsense.recording.before_contact import before_contact
from graspsense.recording.controls import Controls, controls, without_constant_gap
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.readable import each_readable, error_of_all, note_on
from graspsense.recording.replayable import Recording, curve_bytes, grasp_numbers, recorded_channels
from graspsense.sources.columns.recording_notices import notices_together
from graspsense.sources.manifest.alike import compared
from graspsense.sources.recordings.dataset_recordings import failing_as, readable_or_not
from graspsense.sources.recordings.doubtful_rests import notices_of_rests
from graspsense.sources.recordings.noise_thresholds import THRESHOLDS, thresholds_for
from graspsense.store.first_line import first_line_table


def labelled_recordings(
    kind: str, place: str, features: FeatureSet[Any], checkpoints_s: Sequence[float] = ()
) -> Labelled:
    """Return the labelled recordings of a data set; a note counts those that cannot be read.

    Thresholds of the features follow from the recordings where the defaults do not fit them, and a note says which they
    are. Raises ConfigError if there are none, and the first error if none can be read.
    """
    facts: list[LabelledRecording] = []
    rows: list[tuple[Features, Features]] = []
    read = list(readable_or_not(kind, place))
    unreadable = [recording for recording in read if isinstance(recording, UnreadableRecording)]
    known = [recording for recording in read if isinstance(recording, LabelledRecording)]
    known = compared(known, of_file=False)
    fitted, threshold_notes = _fitted(features, [recording.recording for recording in known])
    features = with_checkpoints(fitted, checkpoints_s)
    for recording in known:
        extract = partial(_features_of, recording, features)
        for extracted in each_readable(recording.source, extract) if recording.label else ():
            if isinstance(extracted, UnreadableRecording):
                unreadable.append(extracted)
            else:
                rows.append(extracted)
                facts.append(recording)
    if unreadable and not facts:
        raise error_of_all(unreadable)
    if not facts:
        raise ConfigError(f"{kind}:{place} has no recording with a label")
    table = table_of([features_of for features_of, _ in rows])
    notes, unlabelled = note_on(unreadable, len(read)), sum(not recording.label for recording in known)
    notes += [f"{counted(unlabelled, 'recording')} left out: no label"] if unlabelled else []
    notes += notices_together(facts)
    rests = [(extracted, fact.recording) for (extracted, _), fact in zip(rows, facts, strict=True)]
    notes += [*notices_of_rests(rests, "features"), *threshold_notes]
    units = {unit for fact in facts for unit in fact.recording.units.values()}
    if units:
        notes.append(f"units that are not SI units: {', '.join(sorted(units))}")
    order = order_of(facts)
    return Labelled(
        source=f"{kind}:{place}",
        table=table,
        labels=tuple(fact.label for fact in facts),
        instances=instances_of(facts),
        no_instances="the data set does not say which trials are of the same object",
        order=order,
        no_order="" if order is not None else "the data set does not say when each trial was recorded",
        content=tuple(map(str, grasp_numbers([curve_bytes(fact.recording.readings) for fact in facts]))),
        **_controls(table, [early for _, early in rows], facts),
        notes=tuple(notes),
        provenance={"simulated": False},
    )


def _fitted(features: FeatureSet[Any], recordings: Sequence[Recording]) -> tuple[FeatureSet[Any], list[str]]:
    """Return the features with the thresholds that these recordings need, where they have the defaults, and why."""
    config, default = features.config, type(features.config)()
    keys = [key for key in THRESHOLDS if hasattr(config, key)]
    given = {key: getattr(config, key) for key in keys if getattr(config, key) != getattr(default, key)}
    thresholds = thresholds_for(recordings, {}, given)
    chosen = {
        key: thresholds.settings[f"controller.{key}"]
        for key in keys
        if key not in given and f"controller.{key}" in thresholds.settings
    }
    return (type(features)(evolve(config, **chosen)), [thresholds.words]) if chosen else (features, [])


def _features_of(recording: LabelledRecording, features: FeatureSet[Any]) -> tuple[tuple[Features, Features]]:
    """Return the features of a recording, and those from before contact. Raises WiringError if it lacks a channel."""
    check_recording(recorded_channels(recording.recording), recording.source, features)
    trace = recording.recording.trace()
    with failing_as(f"the feature set {type(features).__name__}"):
        return ((features.extract(trace), before_contact(trace)),)


def instances_of(facts: Sequence[LabelledRecording]) -> tuple[str, ...] | None:
    """Return the instance of each trial with its class in front; None if that of a trial is not known."""
    named = all(fact.instance for fact in facts)
    return tuple(f"{class_of(fact.label)}#{fact.instance}" for fact in facts) if named else None


def order_of(facts: Sequence[LabelledRecording]) -> tuple[int, ...] | None:
    """Return the rank of each trial by its time of recording, or else by its number; None if neither is known."""
    keys: list[Any]
    if all(fact.recorded_at for fact in facts):
        keys = [fact.recorded_at for fact in facts]
    elif all(fact.order is not None for fact in facts):
        keys = [fact.order for fact in facts]
    else:
        return None
    ranks = {key: rank for rank, key in enumerate(sorted(set(keys)))}
    return tuple(ranks[key] for key in keys)


def _controls(table: FeatureTable, early: Sequence[Features], facts: Sequence[LabelledRecording]) -> Controls:
    """Return the controls: features from before contact, and the numbers of the first frame of each recording."""
    first_line = first_line_table(fact.recording.readings[0].frame for fact in facts)
    known_controls = controls(table, table_of(early), first_line=first_line)
    return without_constant_gap(
        known_controls, (fact.recording.columns("gap_m")[0].tolist() for fact in facts)
    )
