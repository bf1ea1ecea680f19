"""The check that what a gripper delivers is recorded, and comes back from the recording, a replay and an export."""

from __future__ import annotations

from datetime import UTC, datetime
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import Grasp, run_grasp
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import GraspsenseError
from graspsense.core.values.signals import EFFORT, Command
from graspsense.core.values.trace import (
    PAD_COLUMNS,
    TICK_COLUMNS,
    ImageTrace,
    SampleTrace,
    Trace,
    TraceRecorder,
)
from graspsense.recording.export_trace import write_npz
from graspsense.recording.layout import DEVICE, START
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorder import Recorder
from graspsense.recording.replayable import Recording
from graspsense.recording.trial_record import TrialRecord
from graspsense.sources.recordings.replay import read_named
from graspsense.testing.checks import CheckFailed, demand
from graspsense.testing.laws import GentleController, kind_of
from graspsense.testing.subject import Subject


def what_it_delivers_is_kept(subject: Subject) -> None:
    """Each tick, image and sample of a grasp is recorded, and the same in the recording, a replay and an export."""
    with TemporaryDirectory() as folder:
        path, exported = Path(folder) / "grasp.mcap", Path(folder) / "grasp.npz"
        try:
            grasp, ticks = _recorded(subject, path)
            demand(
                ticks == len(grasp.trace),
                f"the recording of a grasp has {ticks} of its {len(grasp.trace)} ticks: {grasp.reason}",
            )
            read = read_recorded(path)
            _demand_same(grasp.trace, read.trace(), "its recording")
            _demand_same(grasp.trace, _replayed(read_named("mcap", str(path)), grasp.trace), "a replay")
            write_npz(exported, read)
            _demand_same(grasp.trace, _replayed(read_named("npz", str(exported)), grasp.trace), "an export")
        except GraspsenseError as error:
            raise CheckFailed(f"a grasp cannot be recorded and read back: {error}", str(error)) from error


def _recorded(subject: Subject, path: Path) -> tuple[Grasp, int]:
    """Record a gentle grasp; return it, and the number of ticks in the file."""
    record = TrialRecord(
        made_at=datetime.now(UTC).isoformat(),
        origin="run",
        labels={},
        settings={"gripper": {}},
        provenance={},
    )
    recorder = Recorder(path)

    def opened(device: DeviceInfo) -> None:
        recorder.metadata(DEVICE, record.with_device(device).section(DEVICE))
        recorder.wait_ready()

    try:
        recorder.metadata(START, record.section(START))
        law = GentleController(kind_of(subject.entry.accepts))
        grasp = run_grasp(subject.create(), law, RunConfig(hold_s=0.05), sinks=[recorder], on_open=opened)
    except BaseException:
        recorder.leave()
        raise
    return grasp, recorder.finish().ticks


def _replayed(recording: Recording, grasp: Trace) -> Trace:
    """Return the trace of the readings of a recording, with the phases and commands of the grasp."""
    recorder = TraceRecorder(grasp.units)
    ticks = zip(recording.readings, grasp.phase.tolist(), grasp.command.tolist(), strict=True)
    for reading, phase, value in ticks:
        recorder.add(reading, phase, Command(EFFORT, value, inf, inf))
    return recorder.trace()


def _demand_same(original: Trace, now: Trace, where: str) -> None:
    """Raise CheckFailed for the first column that is not the same."""
    columns: dict[str, tuple[Any, Any]] = {
        name: (getattr(original, name), getattr(now, name)) for name in (*TICK_COLUMNS, *PAD_COLUMNS)
    }
    for name, signal in original.signals.items():
        columns[name] = _values(signal), _values(now.signals.get(name, np.empty(0)))
    for name, (came, kept) in columns.items():
        # Arrays without an image have no size to compare.
        demand(
            not (came.size or kept.size)
            or (came.dtype == kept.dtype and np.array_equal(came, kept, equal_nan=True)),
            f"{name!r} is not in {where} as it was delivered: {_shown(came)} came, {_shown(kept)} is there",
        )


def _values(signal: Any) -> NDArray[Any]:
    """Return the numbers of a further channel. The times of samples between two ticks are computed, not delivered."""
    if isinstance(signal, ImageTrace):
        return signal.cells
    values: NDArray[Any] = signal.values if isinstance(signal, SampleTrace) else signal
    return values


def _shown(values: NDArray[Any]) -> str:
    return f"{' x '.join(map(str, values.shape))} numbers ({', '.join(f'{value:g}' for value in values.flat[:3])}, ...)"
