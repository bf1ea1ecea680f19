"""One grasp that is kept: recorded while it lasts, and in the store when it is over."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from attrs import frozen

from graspsense.core.pipeline import grasp_with
from graspsense.recording.recorder import NotKept, Recorder
from graspsense.recording.trial_record import DEVICE, START, TRIAL, Origin, beginning, device_metadata, ending
from graspsense.store.store import RecordingFacts, Store

if TYPE_CHECKING:
    from graspsense.core.config import Settings
    from graspsense.core.plugins import Plugins
    from graspsense.core.roles import DeviceInfo
    from graspsense.core.runner import Sink
    from graspsense.core.trial import Trial


@frozen(kw_only=True, eq=False)
class KeptGrasp:
    """A grasp and its number in the store; where it could not be kept there is none, and `problem` says why."""

    trial: Trial
    number: int | None
    counts: Mapping[str, int]
    problem: str = ""


def kept_grasp(
    store: Store,
    settings: Settings,
    plugins: Plugins,
    *,
    labels: Mapping[str, str],
    origin: Origin,
    sinks: Iterable[Sink] = (),
    on_open: Callable[[DeviceInfo], None] | None = None,
) -> KeptGrasp:
    """Do one grasp as `grasp_with` does, and keep it.

    A disk that is full, or goes away, does not stop the grasp: what it did is returned, with the problem.
    Raises what `grasp_with` raises, and NotKept where nothing can be recorded to begin with.
    """
    start = beginning(settings, labels, origin)
    recorder = Recorder(store.new_recording(start.made_at))
    described: dict[str, str] = {}

    def opened(device: DeviceInfo) -> None:
        if on_open is not None:
            on_open(device)
        described.update(device_metadata(device))
        recorder.metadata(DEVICE, described)
        recorder.wait_ready()

    try:
        recorder.metadata(START, start.as_metadata())
        trial = grasp_with(settings, plugins, labels=labels, sinks=[*sinks, recorder], on_open=opened)
        end = ending(trial)
    except BaseException:
        recorder.leave()
        raise
    try:
        recorder.metadata(TRIAL, end.as_metadata())
        recorded = recorder.finish()
        facts = RecordingFacts(
            name=recorded.path.name, sha256=recorded.sha256, size=recorded.size, counts=recorded.counts
        )
        device = json.loads(described["device"])
        number = store.add(start, end, device, facts, whole=not recorded.dropped)
    except NotKept as error:
        return KeptGrasp(trial=trial, number=None, counts={}, problem=str(error))
    return KeptGrasp(trial=trial, number=number, counts=recorded.counts)
