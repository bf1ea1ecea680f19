"""What a hand is ordered, and what it says of its state."""

from __future__ import annotations

from typing import Final, NamedTuple

RATE_HZ: Final = 15.0
"""A hand sends at most 15 states a second (users' measurements)."""
WIDEST_M: Final = 0.08
FASTEST_M_S: Final = 0.1
FORCES_N: Final = (30.0, 70.0)
"""Least force, as users found it, and continuous force of the data sheet."""
ANY_WIDTH_M: Final = 1.0
"""Tolerance of a grasp that is to count at any width."""

GRASP: Final = "grasp"
MOVE: Final = "move"
STOP: Final = "stop"


class Order(NamedTuple):
    """A command: `GRASP` to a width with speed and force, `MOVE` to a width with a speed, `STOP`."""

    kind: str
    width_m: float = 0.0
    speed_m_s: float = 0.0
    force_n: float = 0.0


class HandState(NamedTuple):
    """A state of the hand.

    `host_s` is when it arrived, on the monotonic clock of this machine; of an emulated hand its own time. `done` counts
    the orders that have ended, `refused` is the reason of the last one that the hand refused, else empty.
    """

    host_s: float
    width_m: float
    widest_m: float
    grasped: bool
    temperature_c: float
    done: int
    refused: str


class HandGone(Exception):
    """The hand cannot be reached, or no longer; the text says why."""
