"""One grasp that is recorded while it lasts and added to the store when it is over."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from attrs import evolve, frozen

from graspsense.core.components.registry import Plugins
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.grasp.interrupts import Interrupts
from graspsense.core.grasp.pair import Member
from graspsense.core.grasp.sinks import Sink
from graspsense.core.pipeline.pipeline import GraspInterrupted, grasp_with
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.trial import Trial
from graspsense.recording.layout import DEVICE, RESULT, START
from graspsense.recording.recorder import Recorder
from graspsense.recording.trial_record import Origin, TrialRecord
from graspsense.store.store import Store


@frozen(kw_only=True, eq=False)
class RecordedTrial:
    """A grasp with its number in the store and the counters of its recording.

    If it could not be saved, `number` is None and `problem` states why.
    """

    trial: Trial
    number: int | None
    counts: Mapping[str, int]
    problem: str = ""
    interrupted: bool = False
    """Whether the user asked for an end, during the grasp or while it was saved."""


@frozen(kw_only=True, eq=False)
class Beside:
    """A grasp of a pair: its gripper, the recording that is reserved for it, and the name of the other one's."""

    member: Member
    recording: Path
    other: str


def record_grasp(
    store: Store,
    settings: Settings,
    plugins: Plugins,
    *,
    labels: Mapping[str, str],
    origin: Origin,
    sinks: Iterable[Sink] = (),
    on_open: Callable[[DeviceInfo], None] | None = None,
    beside: Beside | None = None,
) -> RecordedTrial:
    """Perform one grasp as `grasp_with` does, record it, and add it to the store.

    A disk that fails during the grasp does not stop it: the trial is returned with the problem. An interrupted grasp is
    stored as well, and nothing interrupts its saving. That of a pair has the recording of the other as its label
    `beside`. Raises what else `grasp_with` raises, SaveFailed if the recording
    cannot be started, and KeyboardInterrupt if the user asked for an end before the fingers moved.
    """
    # The grasp itself ends at a signal; what comes before and after it does not.
    with Interrupts(deferred=True) as interrupts:
        if beside is not None:
            labels = {**labels, "beside": beside.other}
        record = TrialRecord.begin(settings, labels, origin)
        recorder = Recorder(store.new_recording(record.made_at) if beside is None else beside.recording)

        def opened(device: DeviceInfo) -> None:
            nonlocal record
            if interrupts.count:
                raise KeyboardInterrupt
            if on_open is not None:
                on_open(device)
            record = record.with_device(device)
            recorder.metadata(DEVICE, record.section(DEVICE))
            recorder.wait_ready()

        interrupted = False
        try:
            recorder.metadata(START, record.section(START))
            try:
                trial = grasp_with(
                    settings,
                    plugins,
                    labels=record.labels,
                    sinks=[*sinks, recorder],
                    on_open=opened,
                    beside=None if beside is None else beside.member,
                )
            except GraspInterrupted as error:
                trial, interrupted = error.trial, True
            record = record.with_result(trial)
        except BaseException:
            recorder.leave()
            raise
        grasp = _saved(store, record, recorder, trial, interrupted)
        return evolve(grasp, interrupted=interrupted or interrupts.count > 0)


def _saved(
    store: Store, record: TrialRecord, recorder: Recorder, trial: Trial, interrupted: bool
) -> RecordedTrial:
    """Add a grasp that is over to the store, or say why it cannot be."""
    try:
        missing = _missing(trial, recorder, interrupted)
        if missing:
            raise recorder.incomplete(f"{missing} ({trial.reason})" if trial.reason else missing)
        recorder.metadata(RESULT, record.section(RESULT))
        recording = recorder.finish()
        complete = not recording.dropped and recording.ticks == recorder.ticks
        number = store.add(record, recording, complete=complete)
    except SaveFailed as error:
        return RecordedTrial(trial=trial, number=None, counts={}, problem=str(error))
    return RecordedTrial(trial=trial, number=number, counts=recording.counts)


def _missing(trial: Trial, recorder: Recorder, interrupted: bool) -> str:
    """Return what the recorder did not take of a grasp; an interruption can cut off its last tick and event."""
    cut = 1 if interrupted else 0
    ticks, events = len(trial.trace), len(trial.trace.events)
    if recorder.ticks < ticks - cut:
        return f"it has {recorder.ticks} of the {ticks} ticks of the grasp"
    if recorder.events < events - cut:
        return f"it has {recorder.events} of the {events} events of the controller"
    return ""
