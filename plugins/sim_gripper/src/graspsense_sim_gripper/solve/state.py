"""The state that a step changes: that of the plant, and that of the step control."""

from __future__ import annotations

import math
from typing import NamedTuple

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
