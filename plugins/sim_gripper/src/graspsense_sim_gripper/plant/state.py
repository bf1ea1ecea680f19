"""The state of the simulated plant: the motion of the drive, the contact, and the object between the pads.

It is nested, because compiled code has no `_replace`: a function that changes one part builds that part anew and passes
the others on.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple


class Motion(NamedTuple):
    """Position and speed of the motor, and of the gap between the fingertips, which the linkage derives from it."""

    revolutions: float
    speed_rev_s: float
    gap_m: float
    jacobian_m_rev: float
    """Derivative of the gap with respect to the motor's angle (m/rev)."""


class Past(NamedTuple):
    """The last step of a compression, from which the next one is extrapolated."""

    rate_m_s: float = 0.0
    """Mean rate of the compression over that step."""
    change_m_s2: float = 0.0
    """Change of the mean rate from the step before it to that step, divided by the time from middle to middle."""
    span_s: float = math.inf
    """Duration of that step; inf if it says nothing about the next one."""
    before_s: float = math.inf
    """Duration of the step before it; inf if the change says nothing about the next step."""


def without_past(rate_m_s: float) -> Past:
    """Return the last step of a compression that says nothing about the next one but its rate."""
    return Past(rate_m_s, 0.0, math.inf, math.inf)


class ContactState(NamedTuple):
    """The object between the pads, or one half of an object that is held fast: compression, force and memory."""

    compression_m: float
    force_n: float
    slope_n_m: float
    """Stiffness at the last solution, with which the next search begins."""
    states: Any
    """The states of the object's terms, in the order of the terms."""
    pad_m: float = 0.0
    """Compression of the two pads in series. Updated only if the pads creep or have damping."""
    branch_n: float = 0.0
    """Force of the pads' Maxwell branch."""
    past: Past = Past()


Halves = Any
"""A tuple of one `ContactState`, or (). The type decides, so that compiled code moves no numbers that are not used."""


class Contact(NamedTuple):
    """The forces on the two pads and the object between them."""

    left_n: float
    right_n: float
    offset_m: float
    """Position of the object relative to the gripper's centre line, positive towards the right finger."""
    touched: int
    """1 from the first contact on, until the object is released and has recovered its shape."""
    left: ContactState
    """The whole object; where it is held fast, the half at the left finger, as if the other half did the same."""
    right: Halves
    """The half at the right finger of an object that is held fast, as a tuple of it; otherwise ()."""
    pending_s: float = 0.0
    """Time since the release for which the recovery of the object's shape has not been computed yet."""
    unbalanced: int = 0
    """Searches for the balance of forces that have not converged so far."""


def right_of(left: ContactState, right: Halves) -> ContactState:
    """Return the half of the object at the right finger; `left`, the whole, of an object that is not held fast."""
    half: ContactState = (left, *right)[-1]
    return half


class PlantReadings(NamedTuple):
    """What sensors measure of the plant at a tick."""

    motion: Motion
    left_n: float
    right_n: float
    """The forces on the pads."""
