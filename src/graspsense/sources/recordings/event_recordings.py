"""Recordings in which others labelled events, and what a controller tells of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import field, frozen

from graspsense.core.learn.groups import with_sessions
from graspsense.core.learn.labelled import Labelled, class_of
from graspsense.core.values.errors import ConfigError, counted, listed
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.signals import CHANNELS, NO_GAP, Reading, Samples
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.readable import each_readable, error_of_all, note_on
from graspsense.recording.reader import read_recorded
from graspsense.recording.replayable import content_sha256
from graspsense.sources.recordings.dataset_recordings import datasets_with_recordings, readable_or_not
from graspsense.sources.recordings.labelled_recordings import instances_of, order_of
from graspsense.store.opening import STORE
from graspsense.store.stored_grasps import StoredGrasp, stored_grasps

if TYPE_CHECKING:
    from graspsense.core.components.roles import Controller
    from graspsense.recording.replayable import Recording

_FORCES: Final = ("force_left_n", "force_right_n", "edge_left_n", "edge_right_n")
ACCELERATION: Final = "acceleration"


@frozen(kw_only=True, eq=False)
class EventRecordings:
    """Recordings with labelled events, and the group of each, which is held out as a whole; `held_out` names them."""

    recordings: tuple[LabelledRecording, ...]
    groups: tuple[str, ...]
    held_out: str
    notes: tuple[str, ...]


def event_recordings(source: str, only: str | None = None) -> EventRecordings:
    """Return the recordings of a store (`store:DIR`) or of a data set (`manifest:FILE`) in which events are labelled.

    `only` names a class. Notes count those without labels, those that cannot be read, and other units than N. Raises
    ConfigError, DataDamaged.
    """
    kind, _, place = source.partition(":")
    if kind != STORE.removesuffix(":") and (not place or kind not in datasets_with_recordings()):
        known = ", ".join(f"{name}:PLACE" for name in ("store", *datasets_with_recordings()))
        raise ConfigError(
            f"--events needs recordings, and {source!r} is not a source of them. There are {known}"
        )
    read = list(_stored(place) if source.startswith(STORE) else readable_or_not(kind, place))
    unreadable = [recording for recording in read if isinstance(recording, UnreadableRecording)]
    recordings = [
        recording
        for recording in read
        if isinstance(recording, LabelledRecording) and only in (None, class_of(recording.label))
    ]
    if unreadable and not recordings:
        raise error_of_all(unreadable)
    several = {content_sha256(recording.recording): recording for recording in reversed(recordings)}
    copies = len(recordings) - len(several)
    recordings = list(reversed(several.values()))
    labelled = [recording for recording in recordings if recording.recording.events]
    if not labelled:
        raise ConfigError(
            f"{source}: no event is labelled in {counted(len(recordings), 'recording')}"
            f"{f' of {only}' if only else ''}. "
            'In a manifest, events says where: events = { slip = "COLUMN" }'
        )
    notes = note_on(unreadable, len(read))
    if copies:
        notes.append(f"{counted(copies, 'recording')} left out: the same content as another one")
    if len(labelled) < len(recordings):
        notes.append(
            f"{len(recordings) - len(labelled)} of {len(recordings)} recordings left out: no event is labelled"
        )
    units = sorted({unit for each in labelled if (unit := each.recording.units.get("force_left"))})
    if units:
        notes.append(
            f"the forces are in {', '.join(units)}, for which thresholds in N have no meaning: see the fitted ones"
        )
    instances = instances_of(labelled)
    noted = with_sessions(
        Labelled(
            source=source,
            table=FeatureTable(names=(), units=(), values=np.empty((len(labelled), 0))),
            labels=tuple(recording.label for recording in labelled),
            instances=instances,
            order=order_of(labelled),
            notes=tuple(notes),
        )
    )
    return EventRecordings(
        recordings=tuple(labelled),
        groups=noted.instances or noted.labels,
        held_out="label" if instances is None else "instance",
        notes=noted.notes,
    )


def _stored(folder: str) -> Iterator[LabelledRecording | UnreadableRecording]:
    for grasp in stored_grasps(folder):
        yield from each_readable(f"trial {grasp.number}", lambda grasp=grasp: (_of_trial(grasp),))  # type: ignore[misc]


def _of_trial(grasp: StoredGrasp) -> LabelledRecording:
    return LabelledRecording(
        recording=read_recorded(grasp.recording, sha256=grasp.recording_sha256).recording(),
        source=f"trial {grasp.number}",
        label=grasp.label,
        instance=grasp.instance.partition("#")[2],
    )


def check_detector(controller: Controller[Any], recordings: tuple[Recording, ...]) -> None:
    """Raise ConfigError if a controller tells no events, or reads a channel that a recording does not have."""
    law = type(controller)
    if not law.events:
        raise ConfigError(
            f"{law.__name__} tells no events, so it cannot be scored: choose another controller.type"
        )
    for recording in recordings:
        own = {channel.name for channel in recording.channels}
        no_gap = ("gap", "velocity") if recording.units.get("gap") == NO_GAP else ()
        absent = [c.name for c in law.requires if c.name in no_gap or c.name not in (*CHANNELS, *own)]
        if absent:
            raise ConfigError(
                f"{law.__name__} reads {listed(absent)}, and {recording.name} has no such channel"
            )


@frozen(eq=False)
class EventTeller:
    """What a controller tells of each recording, with all of its thresholds times a factor; each is computed once."""

    controller: Controller[Any]
    recordings: tuple[Recording, ...]
    on_told: Callable[[int], None]
    """Called with the number of recordings that have been gone through, each again for every factor."""
    _known: dict[tuple[int, float], dict[str, list[float]]] = field(factory=dict, init=False)

    def __call__(self, number: int, factor: float) -> dict[str, list[float]]:
        """Return the times (s) of the events that are told, by their names."""
        key = (number, factor)
        if key not in self._known:
            self._known[key] = _told(self.controller, self.recordings[number], factor)
            self.on_told(len(self._known))
        return self._known[key]


def _told(controller: Controller[Any], recording: Recording, factor: float) -> dict[str, list[float]]:
    step, params, state = type(controller).step, controller.params(), controller.init()
    names, told = type(controller).events, dict[str, list[float]]()
    for reading in recording.readings:
        # To divide what is measured is to multiply all thresholds.
        _, state = step(params, state, reading if factor == 1.0 else _divided(reading, factor))
        if state.events:
            for k, name in enumerate(names):
                if state.events >> k & 1:
                    told.setdefault(name, []).append(reading.frame.t_s)
    return told


def _divided(reading: Reading, by: float) -> Reading:
    """Return a reading with its forces and its acceleration divided by a number."""
    frame, pads, signals = reading
    frame = frame._replace(**{name: getattr(frame, name) / by for name in _FORCES})
    samples = getattr(signals, ACCELERATION, None)
    if isinstance(samples, Samples):
        values = tuple(tuple(value / by for value in row) for row in samples.values)
        signals = signals._replace(**{ACCELERATION: samples._replace(values=values)})
    return Reading(frame, pads, signals)


def threshold_factor(recordings: tuple[Recording, ...]) -> float:
    """Return what thresholds in N are multiplied by for the unit of these forces: 1 for N.

    For another unit it is a power of ten, by which the median range of the force becomes about 10.
    """
    if not any("force_left" in recording.units for recording in recordings):
        return 1.0
    ranges = sorted(float(np.ptp(recording.columns("force_left_n"))) for recording in recordings)
    middle = ranges[len(ranges) // 2]
    return float(10.0 ** (round(math.log10(middle)) - 1)) if middle > 0.0 else 1.0
