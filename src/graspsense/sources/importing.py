"""Taking in what somebody else recorded: as a recording of ours, whole, and as a trial of a store."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from graspsense.core.pipeline import grasp_with
from graspsense.core.signals import APPROACH
from graspsense.recording.layout import PADS, TICK
from graspsense.recording.recorder import NotKept
from graspsense.recording.trial_record import DEVICE, START, TRIAL, beginning, device_metadata, ending
from graspsense.recording.writer import RecordingFile, Written
from graspsense.sources.replay import KINDS, kind_and_name
from graspsense.store.store import RecordingFacts

if TYPE_CHECKING:
    from pathlib import Path

    from graspsense.core.config import Settings
    from graspsense.core.plugins import Plugins
    from graspsense.core.trial import Trial
    from graspsense.recording.replayable import Recording
    from graspsense.store.store import Store


def import_recording(
    store: Store, settings: Settings, plugins: Plugins, labels: Mapping[str, str]
) -> tuple[Trial, int]:
    """Put a recording through a pipeline whose gripper replays it, keep both, and return trial and number.

    The recording is kept to its end, whenever the controller had enough. Raises ConfigError, DataDamaged, NotKept.
    """
    start = beginning(settings, labels, "import")
    trial = grasp_with(settings, plugins, labels=labels)
    kind, name = kind_and_name(settings.values["gripper"]["recording"])
    path = store.new_recording(start.made_at)
    try:
        file = RecordingFile(path)
        try:
            file.metadata(START, start.as_metadata())
            described = device_metadata(trial.device)
            file.metadata(DEVICE, described)
            _readings(file, KINDS[kind](name))
            end = ending(trial)
            file.metadata(TRIAL, end.as_metadata())
            written = file.finish()
        except BaseException:
            file.remove()
            raise
    except OSError as error:
        raise NotKept(f"the recording {path} could not be written: {error.strerror}") from error
    return trial, store.add(start, end, json.loads(described["device"]), _facts(path, written))


def _readings(file: RecordingFile, recording: Recording) -> None:
    counter = 0
    for frame, pads in recording.readings:
        if pads.counter != counter:
            counter = pads.counter
            file.pads(pads.t_s, PADS.pack(pads.t_s, pads.counter, *pads.left, *pads.right))
        # Nobody of ours commanded anything.
        file.tick(frame.t_s, TICK.pack(*frame, APPROACH, 0, math.nan, math.nan, math.nan))


def _facts(path: Path, written: Written) -> RecordingFacts:
    return RecordingFacts(
        name=path.name,
        sha256=written.sha256,
        size=written.size,
        counts={"ticks": written.ticks, "images": written.images},
    )
