"""Importing recordings of other programs: as complete recordings of our own, and as trials of a store."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from attrs import evolve

from graspsense.core.components.registry import Plugins
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.learn.labelled import class_of
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.errors import FAILURES
from graspsense.core.values.features import Features
from graspsense.core.values.signals import LABELLED, Command
from graspsense.core.values.trace import Trace
from graspsense.core.values.trial import Trial
from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.recording.layout import DEVICE, RESULT, START
from graspsense.recording.recorded_grasp import with_phases_of
from graspsense.recording.replayable import Recording, content_sha256
from graspsense.recording.tick_messages import TickMessages
from graspsense.recording.trial_record import TrialRecord
from graspsense.recording.writer import RecordingWriter
from graspsense.store.imported_contents import CONTENT, ImportedContents
from graspsense.store.store import Store

UNKNOWN: Final = Command(0, math.nan, math.nan, math.nan)
"""The command of another program, which is not known."""


def labels_of_recording(recording: LabelledRecording) -> dict[str, str]:
    """Return what a data set says about a grasp as the labels of a trial."""
    labels = {"label": recording.label} if recording.label else {}
    if recording.label and recording.instance:
        labels["instance"] = f"{class_of(recording.label)}#{recording.instance}"
    if recording.recorded_at:
        labels["recorded_at"] = recording.recorded_at
    if recording.order is not None:
        labels["order"] = f"{recording.order:.17g}"
    return labels | {name: repr(value) for name, value in recording.values.items()}


def import_recording(
    store: Store,
    settings: Settings,
    plugins: Plugins,
    labelled: LabelledRecording,
    contents: ImportedContents,
) -> tuple[Trial, int]:
    """Run a pipeline whose gripper replays a recording, store trial and recording, and return trial and number.

    `settings` name the recording, as `gripper.recording`. The whole recording is stored, even if the controller ended
    earlier. Raises ConfigError, also if the store has its content already, DataDamaged, SaveFailed.
    """
    sha256 = content_sha256(labelled.recording)
    contents.refuse(sha256, labelled.source)
    labels = labels_of_recording(labelled)
    record = TrialRecord.begin(settings, labels, "import")
    about = {CONTENT: sha256, "source": labelled.source}
    record = evolve(record, provenance={**record.provenance, **about})
    trial = grasp_with(settings, plugins, labels=labels)
    trace = with_phases_of(labelled.recording.trace(), trial.trace)
    trial = _with_labels(evolve(trial, features=_features(settings, trace, trial)), labelled.recording)
    record = record.with_device(trial.device).with_result(trial)
    path = store.new_recording(record.made_at)
    try:
        file = RecordingWriter(path)
        try:
            file.metadata(START, record.section(START))
            file.metadata(DEVICE, record.section(DEVICE))
            _write_readings(file, labelled.recording, trace.phase.tolist())
            file.metadata(RESULT, record.section(RESULT))
            recording = file.finish()
        except BaseException:
            file.remove()
            raise
    except OSError as error:
        raise SaveFailed(f"the recording {path} could not be written: {error.strerror}") from error
    number = store.add(record, recording)
    contents.add(sha256, number)
    return trial, number


def _with_labels(trial: Trial, recording: Recording) -> Trial:
    """Return the trial with the events that others labelled in its recording among its own, in the order of time."""
    if not recording.events:
        return trial
    events = [*trial.events, *(event for kind in recording.events.values() for event in kind)]
    report = {**trial.report, LABELLED: ", ".join(recording.events)}
    return evolve(trial, events=tuple(sorted(events, key=lambda event: event.t_s)), report=report)


def _features(settings: Settings, trace: Trace, trial: Trial) -> Features:
    """Return the features of the whole recording, also of what is after the end that the controller saw."""
    try:
        features: Features = settings.features.create().extract(trace)
    except FAILURES:
        return trial.features
    return features


def _write_readings(file: RecordingWriter, recording: Recording, phases: Sequence[int]) -> None:
    """Write all readings, each with its phase."""

    def write(messages: bytes | memoryview) -> None:
        file.messages(bytearray(messages))

    ticks = TickMessages(write)
    for reading, phase in zip(recording.readings, phases, strict=True):
        write(ticks.packed(reading, phase, UNKNOWN))
