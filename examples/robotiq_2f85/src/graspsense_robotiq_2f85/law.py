"""A control law for a gripper without pads: close until the fingers are at rest."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from attrs import frozen

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
    Reading,
    RestState,
    at_rest,
    setting,
    update_rest,
)


@frozen(kw_only=True)
class CloseUntilStoppedConfig:
    """The keys of [controller]."""

    closing_speed_m_s: float = setting(
        default=0.02,
        unit="m/s",
        above=0.0,
        plausible=(1e-3, 0.15),
        meaning="Closing speed of the gap.",
    )
    grip_force_n: float = setting(
        default=25.0,
        unit="N",
        above=0.0,
        plausible=(1.0, 235.0),
        meaning="Force with which the fingers squeeze.",
    )
    contact_effort_n: float = setting(
        default=10.5,
        unit="N",
        above=0.0,
        plausible=(0.1, 235.0),
        meaning="Effort at contact, above that for moving the fingers freely.",
    )
    rest_speed_m_s: float = setting(
        default=1e-3,
        unit="m/s",
        above=0.0,
        plausible=(1e-6, 0.05),
        meaning="Speed below which the fingers are at rest, if throughout the window.",
    )
    rest_window_s: float = setting(
        default=0.15,
        unit="s",
        above=0.0,
        plausible=(0.01, 5.0),
        meaning="Time for which the fingers must stay below the rest speed.",
    )
    closed_gap_m: float = setting(
        default=0.002,
        unit="m",
        above=0.0,
        plausible=(1e-5, 0.085),
        meaning="Gap at which the fingers count as closed.",
    )
    timeout_s: float = setting(
        default=15.0,
        unit="s",
        above=0.0,
        plausible=(0.1, 600.0),
        meaning="Longest duration of approach and squeeze together.",
    )


class State(NamedTuple):
    """State of the law."""

    phase: int
    outcome: int
    seconds: float
    still: RestState


def step(params: CloseUntilStoppedConfig, state: State, reading: Reading) -> tuple[Command, State]:
    """Close; squeeze from contact on; hold when the fingers are at rest."""
    frame = reading.frame
    phase, outcome, seconds = state.phase, state.outcome, state.seconds + frame.dt_s
    still = update_rest(state.still, frame.t_s, frame.gap_m, params.rest_speed_m_s, params.rest_window_s)
    if outcome == RUNNING:
        if phase == APPROACH and frame.effort_n >= params.contact_effort_n:
            phase, still = SQUEEZE, RestState(frame.t_s, frame.gap_m)
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
        return State(APPROACH, RUNNING, 0.0, RestState(0.0, 0.0))
