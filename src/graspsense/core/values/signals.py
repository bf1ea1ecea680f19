"""The values that pass between a gripper and a controller: readings, commands, events, and the outcome of a grasp.

What a control law takes and returns are named tuples of numbers in SI units, so that the same law runs in the
interpreter and compiled. The gap is the distance between the fingertip faces; it decreases on closing, so a closing
velocity is negative. An effort is the force on each finger without losses in the drive; a positive effort squeezes.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from math import nan
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, get_args

from attrs import frozen

if TYPE_CHECKING:
    from graspsense.core.values.features import Prediction

CHANNELS: Final = {
    "gap": "m",
    "velocity": "m/s",
    "effort": "N",
    "force_left": "N",
    "force_right": "N",
    "edge_left": "N",
    "edge_right": "N",
    "pads": "counts",
}
"""The channels of a frame and of its fingertips, each with its unit. Every other channel is in `Reading.signals`."""


class Frame(NamedTuple):
    """The measurements of one tick.

    A channel that the backend lacks is NaN, which is the default. Forces are tared. `edge_*` is the largest force on a
    single edge cell (0-6) of that fingertip. `status` is a bit set whose meaning the backend defines; 0 means no error.
    """

    t_s: float
    dt_s: float
    gap_m: float = nan
    velocity_m_s: float = nan
    effort_n: float = nan
    force_left_n: float = nan
    force_right_n: float = nan
    edge_left_n: float = nan
    edge_right_n: float = nan
    status: int = 0


CHANNEL_OF_FIELD: Final[Mapping[str, str]] = dict(zip(Frame._fields[2:9], CHANNELS, strict=False))
"""Each field of a frame that is a channel, with the name of that."""


class Pads(NamedTuple):
    """The last cell image of the two fingertips, raw, which comes at a lower rate than frames.

    `left` and `right` have one number for each cell, in the order of the array that the backend declares as `pads`.
    `counter` increases by one with each new image, and by more where images were lost. It is 0, and the cells are NaN,
    before the first image.
    """

    t_s: float
    counter: int
    left: tuple[float, ...]
    right: tuple[float, ...]


def no_pads(cells: int) -> Pads:
    """Return the image of two fingertips with so many cells before the first image: counter 0, cells NaN.

    >>> no_pads(2)
    Pads(t_s=0.0, counter=0, left=(nan, nan), right=(nan, nan))
    """
    return Pads(0.0, 0, (nan,) * cells, (nan,) * cells)


NO_PADS: Final = no_pads(0)
"""The image of a gripper without cells on its fingertips."""


class Image(NamedTuple):
    """The last image of a tactile array other than the fingertips': the cells, as the array declares them.

    `cells` has a float for each cell, or of several components a tuple of these. Of an array with another `dtype`
    than float64 it is a numpy array of the shape `TactileArray.shape`: contiguous, read-only, and not changed by
    anyone after it was delivered. NaN stands for a cell without a value. `counter` increases by one with each new
    image, and by more where images were lost. It is 0, and the cells are NaN (0 in whole numbers), before the first
    image.
    """

    t_s: float
    counter: int
    cells: Any


class Samples(NamedTuple):
    """The samples of a fast channel that are new in this tick, oldest first.

    `values` has one row for each sample that a tick can hold, with one number for each axis. The first `new` rows are
    new; the others are NaN. `counter` is the number of samples that the sensor has taken since the gripper was opened.
    It increases by more than `new` where samples were lost. `t_s` is the time of the last sample.
    """

    t_s: float
    counter: int
    new: int
    values: tuple[tuple[float, ...], ...]


class Reading(NamedTuple):
    """What a gripper measured in one tick: the frame, the last image of its fingertips, and its further channels.

    `signals` is a named tuple with a field for each channel that is not part of the frame, under the name of the
    channel: a float, an `Image` of a tactile array, or the `Samples` of a fast channel. It is empty where the gripper
    has no further channels. `signal_type` makes its class from the declared channels.
    """

    frame: Frame
    pads: Pads
    signals: Any = ()


class Command(NamedTuple):
    """A command to the gripper: its kind, its value, and limits of effort (N) and speed (m/s), `inf` for no limit.

    The value is, for `EFFORT`, the effort in N (positive squeezes); for `VELOCITY`, the rate of the gap in m/s
    (negative closes); for `POSITION`, the gap in m; for `FORCE`, the force on each pad in N.
    """

    kind: int
    value: float
    effort_limit_n: float
    speed_limit_m_s: float


class Phase(enum.IntEnum):
    """The phase of a grasp. A controller reports APPROACH, SQUEEZE and HOLD; the runner sets the others."""

    OPENING = 0
    TARING = 1
    APPROACH = 2
    SQUEEZE = 3
    HOLD = 4
    RELEASE = 5


NO_GAP: Final = "none"
"""The unit of the gap of a recording that has none; its numbers are 0."""


class Outcome(enum.IntEnum):
    """How a grasp ended. This is a value; no exception is raised for it."""

    RUNNING = 0
    STEADY = 1
    NEVER_STEADY = 2
    NOTHING_THERE = 3
    TOO_WIDE = 4
    SIDE_IMPACT = 5
    ONE_FINGER = 6
    CRUSHED = 7
    SLIPPED = 8
    DEVICE_LOST = 9
    ABORTED = 10
    RECOGNISED = 11
    FORCE_ONLY = 12

    @property
    def words(self) -> str:
        """The outcome in words: `never steady`."""
        return self.name.lower().replace("_", " ")


# The same numbers as plain integers, for control laws: to a compiler, a named tuple with an enum member and one with
# an integer are of different types.
EFFORT: Final = 0
"""The value of the command is an effort in N; a positive one squeezes."""
VELOCITY: Final = 1
"""The value of the command is the rate of the gap in m/s; a negative one closes."""
POSITION: Final = 2
"""The value of the command is a gap in m."""
FORCE: Final = 3
"""The value of the command is the force on each pad in N."""

APPROACH: Final = 2
"""The fingers close and do not touch yet; the first state of a law has this phase."""
SQUEEZE: Final = 3
"""Both pads touch, and the fingers still move."""
HOLD: Final = 4
"""The fingers are at rest on the object."""
CLOSING: Final = (APPROACH, SQUEEZE, HOLD)
"""The phases of a law, in which the fingers may press something."""

RUNNING: Final = 0
"""The grasp goes on; every other outcome ends it."""
STEADY: Final = 1
"""The fingers came to rest on the object."""
NEVER_STEADY: Final = 2
"""Both pads touched, and the fingers did not come to rest in time."""
NOTHING_THERE: Final = 3
"""The fingers closed, or the time passed, without a contact."""
TOO_WIDE: Final = 4
"""The pads touched at once: the object is wider than the opening."""
SIDE_IMPACT: Final = 5
"""An edge of a fingertip touched something first."""
ONE_FINGER: Final = 6
"""Only one pad touched in time."""
CRUSHED: Final = 7
"""The force fell while the fingers closed further: the object gave way."""
SLIPPED: Final = 8
"""Both pads lost contact while the fingers closed further."""


EventSource = Literal["runner", "controller", "model", "label"]
"""What an event of a grasp comes from."""
LABELLED: Final = "labelled_events"
"""Key in the report of a trial: the names of the events that were looked for in its recording, also without any."""
NOT_KNOWN: Final = " not known"
"""Behind the name of a labelled event: until then it is not known whether it goes on, or when it began."""


@frozen
class GraspEvent:
    """An event of a grasp: its time (s), the phase, and a sentence.

    `source` is `runner` for a change of phase, an action of the guard or a sink that failed, and `controller` for an
    event that the controller told; `what` is then the name of the event, one of `Controller.events`. It is `model` for
    a prediction while the grasp goes on, which `prediction` then has. It is `label` for what others labelled in a
    recording that they made: from `t_s` until `until_s`, which is `t_s` where only the beginning is known.
    """

    t_s: float
    phase: Phase
    what: str
    source: EventSource = "runner"
    prediction: Prediction | None = None
    until_s: float | None = None


def event_name(names: Sequence[str], number: int) -> str:
    """Return the name of the event of a controller with this number, given its `events`."""
    return names[number] if number < len(names) else f"event {number}"


def event_as_json(event: GraspEvent) -> dict[str, Any]:
    """Return an event as JSON values."""
    values = {
        "t_s": event.t_s,
        "phase": event.phase.name.lower(),
        "what": event.what,
        "source": event.source,
    }
    return values if event.until_s is None else {**values, "until_s": event.until_s}


def event_from_json(value: Mapping[str, Any]) -> GraspEvent:
    """Return the event of `event_as_json`; without a source it is of the runner. Raises KeyError, ValueError."""
    source: EventSource = next(
        (argument for argument in get_args(EventSource) if argument == value.get("source")), "runner"
    )
    until = value.get("until_s")
    return GraspEvent(
        float(value["t_s"]),
        Phase[str(value["phase"]).upper()],
        str(value["what"]),
        source,
        until_s=None if until is None else float(until),
    )
