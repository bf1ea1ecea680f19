"""What passes between a gripper and a controller: frames, cell images, commands, and how a grasp ended.

Everything here is plain numbers in named tuples, so that the same law runs in the interpreter and compiled.
SI units. The gap is the distance between the fingertip faces; closing makes it fall, so a closing velocity is
negative. An effort is the force on each finger if nothing were lost on the way; positive squeezes.
"""

from __future__ import annotations

import enum
from typing import Final, NamedTuple

CELLS: Final = 22
"""Number of cells of a fingertip, as the PR2 has them: 0 at the back, 1 to 6 along the edges, 7 to 21 on the gripping
face in five rows of three. Images of any gripper have this layout so far; a cell that it lacks is NaN."""
FIRST_PAD_CELL: Final = 7
"""The first cell on the gripping face of the PR2; the cells before it are edge cells."""

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
"""Channels a backend can declare, with the unit each must have."""


class Frame(NamedTuple):
    """One tick, numbers only.

    A channel that the backend does not have is NaN. Forces are tared. `edge_*` is the largest force on any
    single edge cell (0-6) of that fingertip. `status` is a set of bits: 0 is well, the rest is the backend's.
    """

    t_s: float
    dt_s: float
    gap_m: float
    velocity_m_s: float
    effort_n: float
    force_left_n: float
    force_right_n: float
    edge_left_n: float
    edge_right_n: float
    status: int


class Pads(NamedTuple):
    """The last cell image, on the pads' own slower clock: raw counts of 22 cells a fingertip.

    `counter` rises by one with each new image. A backend without pads gives counter 0 and NaN cells.
    """

    t_s: float
    counter: int
    left: tuple[float, ...]
    right: tuple[float, ...]


NO_PADS: Final = Pads(0.0, 0, (float("nan"),) * CELLS, (float("nan"),) * CELLS)


class Command(NamedTuple):
    """What the gripper is asked for: one of the four kinds, its value, and limits (none is `inf`).

    Values by kind: `EFFORT` in N, positive squeezes; `VELOCITY` of the gap in m/s, negative closes; `POSITION`
    of the gap in m; `FORCE` on each pad in N.
    """

    kind: int
    value: float
    effort_limit_n: float
    speed_limit_m_s: float


class CommandKind(enum.IntEnum):
    """The kinds of `Command`."""

    EFFORT = 0
    VELOCITY = 1
    POSITION = 2
    FORCE = 3


class Phase(enum.IntEnum):
    """Where a grasp stands. A controller reports APPROACH, SQUEEZE and HOLD; the runner owns the rest."""

    OPENING = 0
    TARING = 1
    APPROACH = 2
    SQUEEZE = 3
    HOLD = 4
    RELEASE = 5


class Outcome(enum.IntEnum):
    """How a grasp ended. A value, never an exception."""

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

    @property
    def words(self) -> str:
        """The outcome as a person says it: `never steady`."""
        return self.name.lower().replace("_", " ")


# The same numbers as plain integers: laws compare these, because a named tuple that holds an enum member is
# another type to a compiler than one that holds an integer.
EFFORT: Final = 0
VELOCITY: Final = 1
POSITION: Final = 2
FORCE: Final = 3

APPROACH: Final = 2
SQUEEZE: Final = 3
HOLD: Final = 4

RUNNING: Final = 0
STEADY: Final = 1
NEVER_STEADY: Final = 2
NOTHING_THERE: Final = 3
TOO_WIDE: Final = 4
SIDE_IMPACT: Final = 5
ONE_FINGER: Final = 6
CRUSHED: Final = 7
SLIPPED: Final = 8
