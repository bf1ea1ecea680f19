"""The parameters of steps, the state that they change, and what a step begins and ends with."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.plant.contact import next_contacts
from graspsense_sim_gripper.plant.drive import (
    ARREST_M_S,
    Drive,
    acceleration,
    breakaway_friction,
    load_at_rest,
    sliding_friction,
)
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.state import Contact, Motion, right_of


class StepState(NamedTuple):
    """The state of the step control between steps."""

    next_s: float = math.inf
    """Length of the next step that the error of the last one allows."""
    n_steps: int = 0
    """Steps so far."""
    unresolved: int = 0
    """Steps that were accepted although their error was too large."""


class PlantState(NamedTuple):
    """The state of the plant between two ticks."""

    motion: Motion
    contact: Contact
    step: StepState = StepState()
    effort_n: float = 0.0
    """Current force of the drive, if it lags behind the command."""
    peak_n: float = 0.0
    """Largest force on a pad so far."""


def with_step(state: PlantState, step: StepState) -> PlantState:
    """Return the same plant, with this state of the step control."""
    motion, contact, _, effort_n, peak_n = state
    return PlantState(motion=motion, contact=contact, step=step, effort_n=effort_n, peak_n=peak_n)


def is_finite(state: PlantState) -> bool:
    """Return whether the forces on the object and the motion are finite numbers."""
    contact = state.contact
    return math.isfinite(
        contact.left.force_n + right_of(contact.left, contact.right).force_n + state.motion.speed_rev_s
    )


SPEED_SCALE_M_S: Final = 1e-3
FORCE_SCALE_N: Final = 1.0
"""Errors are relative to the speed and the force, or to these values if those are smaller."""


class Steps(NamedTuple):
    """How a tick is divided into steps."""

    tolerance: float
    """Error of a step, relative to force and speed, beyond which it is rejected."""
    longest_s: float = math.inf
    settle: float = 0.0
    """Relative change of speed and force at which the halving of steps ends; 0: steps are not halved."""
    growth: float = 2.0
    """Largest ratio of a step to the last one while something is pressed.

    After a contact at time t_c a step is then at most (growth - 1) (t - t_c) long, however short the first one was.
    inf: a contact does not shorten the next step."""
    longest_touched_s: float = math.inf
    """The longest step after the object was touched; it resolves the fastest oscillation of a term."""
    macro_tolerance: float = 0.0
    """Relative error of a step over several ticks, beyond which it is not taken; 0: no step is longer than a tick."""


class PlantParams(NamedTuple):
    """The constants of a grasp: the drive, the object, and how a tick is divided into steps."""

    drive: Drive
    object: ObjectModel
    steps: Steps


class Start(NamedTuple):
    """The state before a step, with the quantities that it needs."""

    motion: Motion
    contact: Contact
    direction: float
    """+1 if the gap opens, or would without friction; -1 if it closes."""
    acceleration: float
    """rev/s2"""
    reach_m: float
    """The gap at which the nearer finger touches the object."""
    meeting_m: float
    """The gap of the next contact: `reach_m`, or that of the other finger if one touches already."""


class Attempt(NamedTuple):
    """The state after a step, and estimates of its errors. It does not say whether the step is accepted."""

    motion: Motion
    contact: Contact
    duration_s: float
    """Shorter than the requested step if the step itself ends at an event."""
    speed_error_m_s: float
    force_error_n: float


def start_of(params: PlantParams, state: PlantState, effort_n: float) -> Start:
    """Return the start of a step under this effort, from a state that is not held."""
    drive, model, _ = params
    motion, contact = state.motion, state.contact
    _, speed, gap, jacobian = motion
    load = 0.5 * (contact.left_n + contact.right_n)
    net = load - effort_n
    if speed == 0.0:
        load = load_at_rest(contact, effort_n)
        net = load - effort_n
        direction = 1.0 if net > 0.0 else -1.0
        friction_n = breakaway_friction(drive.friction, load)
    else:
        direction = 1.0 if speed > 0.0 else -1.0
        friction_n = sliding_friction(drive.friction, speed * jacobian, load)
    rate = acceleration(drive, jacobian, speed, net, friction_n, direction)
    reach, meeting = next_contacts(model, contact, gap)
    return Start(
        motion=motion,
        contact=contact,
        direction=direction,
        acceleration=rate,
        reach_m=reach,
        meeting_m=meeting,
    )


def comes_to_rest(start: Start) -> bool:
    """Return whether the drive comes to rest, because it is slow and decelerates."""
    slowing = start.acceleration * start.direction < 0.0
    return slowing and abs(start.motion.speed_rev_s * start.motion.jacobian_m_rev) < ARREST_M_S


def end_of_travel(drive: Drive, direction: float) -> float:
    """Return the angle (revolutions) at which the travel in this direction ends."""
    return drive.open_rev if direction > 0.0 else drive.closed_rev
