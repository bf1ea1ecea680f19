"""Importing a recording of another program: as a complete recording of our own, and as a trial of a store."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from graspsense.core.pipeline import grasp_with
from graspsense.core.signals import APPROACH, Reading
from graspsense.recording.atomic_file import SaveFailed
from graspsense.recording.layout import DEVICE, RESULT, START, TICK, pads_numbers, pads_topic, signal_topics
from graspsense.recording.trial_record import TrialRecord
from graspsense.recording.writer import RecordingWriter
from graspsense.sources.replay import KINDS, kind_and_name

if TYPE_CHECKING:
    from graspsense.core.config import Settings
    from graspsense.core.plugins import Plugins
    from graspsense.core.trial import Trial
    from graspsense.recording.replayable import Recording
    from graspsense.store.store import Store


def import_recording(
    store: Store, settings: Settings, plugins: Plugins, labels: Mapping[str, str]
) -> tuple[Trial, int]:
    """Run a pipeline whose gripper replays a recording, store trial and recording, and return trial and number.

    The whole recording is stored, even if the controller ended earlier. Raises ConfigError, DataDamaged, SaveFailed.
    """
    record = TrialRecord.begin(settings, labels, "import")
    trial = grasp_with(settings, plugins, labels=labels)
    record = record.with_device(trial.device).with_result(trial)
    kind, name = kind_and_name(settings.values["gripper"]["recording"])
    path = store.new_recording(record.made_at)
    try:
        file = RecordingWriter(path)
        try:
            file.metadata(START, record.section(START))
            file.metadata(DEVICE, record.section(DEVICE))
            _write_readings(file, KINDS[kind](name), trial.trace.phase.tolist())
            file.metadata(RESULT, record.section(RESULT))
            recording = file.finish()
        except BaseException:
            file.remove()
            raise
    except OSError as error:
        raise SaveFailed(f"the recording {path} could not be written: {error.strerror}") from error
    return trial, store.add(record, recording)


def _write_readings(file: RecordingWriter, recording: Recording, phases: Sequence[int]) -> None:
    """Write all readings, each with the phase that the controller was in; the last one holds after its end."""
    counter = 0
    pads_number = -1
    sources: list[tuple[int, struct.Struct, Callable[[Reading], tuple[Any, ...] | None]]] | None = None
    after = len(recording.readings) - len(phases)
    every_phase = [*phases, *[phases[-1] if phases else APPROACH] * after]
    for reading, phase in zip(recording.readings, every_phase, strict=True):
        frame, pads, signals = reading
        if pads.counter != counter:
            counter = pads.counter
            layout = pads_topic(len(pads.left))
            if pads_number < 0:
                pads_number = file.topic(layout)
            file.signal(pads_number, layout.wire.pack(*pads_numbers(pads)))
        if signals and sources is None:
            sources = [(file.topic(topic), topic.wire, source) for topic, source in signal_topics(signals)]
        for number, wire, source in sources or ():
            numbers = source(reading)
            if numbers is not None:
                file.signal(number, wire.pack(*numbers))
        # The commands of the other program are not known.
        file.tick(frame.t_s, TICK.pack(*frame, phase, 0, math.nan, math.nan, math.nan))
