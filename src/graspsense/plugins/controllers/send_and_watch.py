"""Send and watch: the law for a gripper that closes by itself to a target, with a speed and a force.

Such a gripper is sent where to go, how fast and how hard, and then watched. The law approaches with the least force,
stops at the contact, raises the force in steps, and waits until the fingers rest.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any, Literal, NamedTuple

from attrs import frozen

from graspsense.plugin_api import (
    APPROACH,
    FORCE,
    HOLD,
    NEVER_STEADY,
    NOTHING_THERE,
    ONE_FINGER,
    POSITION,
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
    both_touch,
    setting,
    update_rest,
)

MOVED_M = 1e-3
"""Travel after which fingers that stand still have met something: they have begun to move before."""


@frozen(kw_only=True)
class SendAndWatchConfig:
    """Settings of the law."""

    closing_speed_m_s: float = setting(
        default=0.010, unit="m/s", above=0.0, plausible=(1e-4, 0.2), meaning="Closing speed of the gap."
    )
    approach_force_n: float = setting(
        default=5.0,
        unit="N",
        above=0.0,
        plausible=(0.1, 200.0),
        meaning="Force with which the fingers approach; at least what moves them.",
    )
    probing_force_n: float = setting(
        default=20.0, unit="N", above=0.0, plausible=(0.1, 200.0), meaning="Force of the squeeze."
    )
    force_step_n: float = setting(
        default=5.0,
        unit="N",
        above=0.0,
        plausible=(0.01, 200.0),
        meaning="By how much the force rises in a step.",
    )
    step_time_s: float = setting(
        default=0.1,
        unit="s",
        above=0.0,
        plausible=(0.01, 5.0),
        meaning="Time of a step, and for which the fingers stop at the contact.",
    )
    pads: bool = setting(
        default=False,
        meaning="Whether the pads tell the contact; otherwise it is where the fingers stop under the force of the "
        "approach.",
    )
    contact_force_n: float = setting(
        default=0.625,
        unit="N",
        above=0.0,
        plausible=(0.01, 20.0),
        meaning="With pads: force on each at contact.",
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
        plausible=(1e-5, 0.1),
        meaning="Gap at which the fingers count as closed.",
    )
    timeout_s: float = setting(
        default=30.0,
        unit="s",
        above=0.0,
        plausible=(0.1, 600.0),
        meaning="Longest duration of approach and squeeze together.",
    )
    sends: Literal["position", "force", "velocity"] = setting(
        default="position",
        meaning="What is commanded: a target with force and speed, a force with a speed, or a speed with a force.",
    )


class SendAndWatchState(NamedTuple):
    """State of the law: where and when it began, the force that is sent and since when, and where the contact was."""

    phase: int
    outcome: int
    began_t_s: float
    began_gap_m: float
    force_n: float
    since_t_s: float
    contact_gap_m: float
    still: RestState


def command_of(params: Any, force_n: float, target_m: float) -> Command:
    """Return the command that closes to this target with this force; a target above 0 is where the fingers stop."""
    if params.sends == FORCE:
        return Command(FORCE, force_n, inf, params.closing_speed_m_s)
    if params.sends == VELOCITY:
        speed = -params.closing_speed_m_s if target_m == 0.0 else 0.0
        return Command(VELOCITY, speed, force_n, inf)
    return Command(POSITION, target_m, force_n, params.closing_speed_m_s)


def step(params: Any, state: SendAndWatchState, reading: Reading) -> tuple[Command, SendAndWatchState]:
    """Approach, stop at the contact, raise the force in steps, and hold when the fingers are at rest."""
    frame = reading.frame
    phase, outcome, began, began_gap, force, since, contact_gap, still = state
    if began != began:
        began, began_gap, still = frame.t_s, frame.gap_m, RestState(frame.t_s, frame.gap_m)
    still = update_rest(still, frame.t_s, frame.gap_m, params.rest_speed_m_s, params.rest_window_s)
    rests = at_rest(still, frame.t_s, params.rest_window_s)
    if outcome == RUNNING and phase == APPROACH:
        stopped = rests and began_gap - frame.gap_m >= MOVED_M
        felt = params.pads == 1 and both_touch(
            frame.force_left_n, frame.force_right_n, params.contact_force_n
        )
        if frame.gap_m <= params.closed_gap_m:
            outcome = NOTHING_THERE
        elif felt or (stopped and params.pads == 0):
            phase, since, contact_gap = SQUEEZE, frame.t_s, frame.gap_m
        elif stopped:
            outcome = ONE_FINGER
    elif outcome == RUNNING:
        if frame.gap_m <= params.closed_gap_m:
            outcome = NOTHING_THERE
        elif force < params.probing_force_n:
            if frame.t_s - since >= params.step_time_s:
                force = min(force + params.force_step_n, params.probing_force_n)
                since, contact_gap, still = frame.t_s, nan, RestState(frame.t_s, frame.gap_m)
        elif rests:
            phase, outcome = HOLD, STEADY
    if outcome == RUNNING and frame.t_s - began > params.timeout_s:
        outcome = NOTHING_THERE if phase == APPROACH else NEVER_STEADY
    target = contact_gap if contact_gap == contact_gap else 0.0
    return command_of(params, force, target), SendAndWatchState(
        phase, outcome, began, began_gap, force, since, contact_gap, still
    )


class SendAndWatchController(Controller[SendAndWatchConfig]):
    """For a gripper that closes by itself: sends target, speed and force, and watches."""

    commands = ("position",)
    alternatives = ("force", "velocity")
    step = staticmethod(step)

    @property
    def requires(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """The gap, and the forces of the pads if these tell the contact."""
        pads = (Channel("force_left", "N"), Channel("force_right", "N")) if self.config.pads else ()
        return (Channel("gap", "m"), *pads)

    def asked_force_n(self) -> float:
        """Return the probing force (N)."""
        return float(max(self.config.probing_force_n, self.config.approach_force_n))

    def gentlest_force_n(self) -> float:
        """Return the force of the approach (N)."""
        return float(self.config.approach_force_n)

    def asked_speed_m_s(self) -> float:
        """Return the closing speed (m/s)."""
        return float(self.config.closing_speed_m_s)

    def contact_force_n(self) -> float:
        """Return the contact force (N)."""
        return float(self.config.contact_force_n)

    def init(self) -> SendAndWatchState:
        """Return the state before the first tick."""
        approach_n = float(self.config.approach_force_n)
        return SendAndWatchState(APPROACH, RUNNING, nan, nan, approach_n, 0.0, nan, RestState(0.0, 0.0))
