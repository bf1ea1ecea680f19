"""A control law for a gripper without pads: close until the fingers are at rest."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from attrs import field, frozen
from attrs.validators import gt

from graspsense.plugin_api import (
    APPROACH,
    HOLD,
    NEVER_STEADY,
    NOTHING_THERE,
    RUNNING,
    SQUEEZE,
    STEADY,
    VELOCITY,
    Channel,
    Command,
    Controller,
    Frame,
    Pads,
    Stillness,
    at_rest,
    watch,
)


@frozen(kw_only=True)
class CloseUntilStoppedConfig:
    """The keys of [controller]."""

    closing_speed_m_s: float = field(default=0.02, validator=gt(0.0))
    grip_force_n: float = field(default=25.0, validator=gt(0.0))
    contact_effort_n: float = field(default=10.5, validator=gt(0.0))
    """Effort at contact, above that for moving the fingers freely."""
    rest_speed_m_s: float = field(default=1e-3, validator=gt(0.0))
    rest_window_s: float = field(default=0.15, validator=gt(0.0))
    closed_gap_m: float = field(default=0.002, validator=gt(0.0))
    timeout_s: float = field(default=15.0, validator=gt(0.0))


class State(NamedTuple):
    """State of the law."""

    phase: int
    outcome: int
    seconds: float
    still: Stillness


def step(params: CloseUntilStoppedConfig, state: State, frame: Frame, pads: Pads) -> tuple[Command, State]:
    """Close; squeeze from contact on; hold when the fingers are at rest."""
    phase, outcome, seconds = state.phase, state.outcome, state.seconds + frame.dt_s
    still = watch(state.still, frame.t_s, frame.gap_m, params.rest_speed_m_s, params.rest_window_s)
    if outcome == RUNNING:
        if phase == APPROACH and frame.effort_n >= params.contact_effort_n:
            phase, still = SQUEEZE, Stillness(frame.t_s, frame.gap_m)
        elif phase == SQUEEZE and at_rest(still, frame.t_s, params.rest_window_s):
            phase, outcome = HOLD, STEADY
        elif frame.gap_m <= params.closed_gap_m:
            outcome = NOTHING_THERE
        elif seconds > params.timeout_s:
            outcome = NOTHING_THERE if phase == APPROACH else NEVER_STEADY
    command = Command(VELOCITY, -params.closing_speed_m_s, params.grip_force_n, inf)
    return command, State(phase, outcome, seconds, still)


class CloseUntilStopped(Controller[CloseUntilStoppedConfig]):
    """Closes at a given speed with a given force until the fingers are at rest."""

    requires = (Channel("gap", "m"), Channel("effort", "N"))
    commands = ("velocity",)
    step = staticmethod(step)

    def init(self) -> State:
        """Return the state before the first tick."""
        return State(APPROACH, RUNNING, 0.0, Stillness(0.0, 0.0))
