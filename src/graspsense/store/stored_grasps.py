"""The grasps of a store for a plugin that writes them as a data set of another program."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from attrs import frozen

from graspsense.core.values.channel import Channel
from graspsense.core.values.errors import ConfigError
from graspsense.recording.reader import read_recorded
from graspsense.store.store import Store

if TYPE_CHECKING:
    from graspsense.core.values.trace import Trace


@frozen(kw_only=True)
class StoredGrasp:
    """A trial of a store: what is known of it, and its trace, which is read when it is asked for.

    `label` and `instance` are empty where they are not known. `features` has the value of each feature (None if it is
    missing), `units` their units, and those of the channels are those of the trace. `prediction` and `events` are as
    `graspsense run --json` prints them. `source` is the recording that was imported, and empty for other trials.
    """

    number: int
    label: str
    instance: str
    outcome: str
    source: str
    device: str
    simulated: bool
    features: Mapping[str, float | None]
    units: Mapping[str, str]
    prediction: Mapping[str, Any] | None
    events: tuple[Mapping[str, Any], ...]
    channels: tuple[Channel, ...]
    recording: Path

    def trace(self) -> Trace:
        """Return the trace of the whole recording. Raises ConfigError, DataDamaged."""
        return read_recorded(self.recording).trace()


def stored_grasps(folder: str | Path) -> tuple[StoredGrasp, ...]:
    """Return the complete trials of a store that are not set aside, oldest first.

    Raises ConfigError if there is none, DataDamaged.
    """
    with Store.read(folder) as store:
        numbers = store.query("SELECT id FROM trial WHERE set_aside IS NULL AND complete = 1 ORDER BY id")
        if not numbers:
            raise ConfigError(f"the store in {folder} has no complete trial to export")
        return tuple(_grasp(store, number) for (number,) in numbers)


def _grasp(store: Store, number: int) -> StoredGrasp:
    trial = store.trial(number)
    result, device = trial.result, trial.record.device
    details = result.details
    return StoredGrasp(
        number=number,
        label=trial.summary.label or "",
        instance=trial.summary.instance or "",
        outcome=result.outcome,
        source=str(trial.record.settings.get("gripper", {}).get("recording", "")),
        device=trial.summary.device,
        simulated=trial.summary.simulated,
        features=dict(
            zip((name for name, _ in result.features.features), result.features.values, strict=True)
        ),
        units=dict(result.features.features),
        prediction=details.get("prediction"),
        events=tuple(details.get("events") or ()),
        channels=device.channels if device else (),
        recording=trial.recording,
    )
