"""Send and watch: the law for a gripper that closes by itself to a target, with a speed and a force.

Such a gripper is sent where to go, how fast and how hard, and then watched. The law approaches with the least force,
stops at the contact, raises the force in steps, and waits until the fingers rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf, nan
from typing import Any, ClassVar, Literal, NamedTuple

from attrs import frozen

from graspsense.gripper_api import MOVED_M
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
from graspsense.plugins.controllers.own_loop import (
    STEPS,
    OwnLoopConfig,
    Raised,
    approaching,
    raised,
    rises,
)


@frozen(kw_only=True)
class SendAndWatchConfig(OwnLoopConfig):
    """Settings of the law."""

    closing_speed_m_s: float = setting(
        default=0.010, unit="m/s", above=0.0, plausible=(1e-4, 0.2), meaning="Closing speed of the gap."
    )
    probing_force_n: float = setting(
        default=20.0, unit="N", above=0.0, plausible=(0.1, 200.0), meaning="Force of the squeeze."
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
        meaning="At rest, the gap changes by less than this times the window, throughout it.",
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
    """State of the law: where and when it began, what is sent, and since when the fingers rest."""

    phase: int
    outcome: int
    began_t_s: float
    began_gap_m: float
    sent: Raised
    still: RestState


def command_of(params: Any, sent: Raised) -> Command:
    """Return the command that closes, or stops at a gap, with this force; `params` has the numbers of the config."""
    force_n, _, stop_gap_m = sent
    stops = stop_gap_m == stop_gap_m
    if params.sends == FORCE:
        return Command(FORCE, force_n, inf, params.closing_speed_m_s)
    if params.sends == VELOCITY:
        return Command(VELOCITY, 0.0 if stops else -params.closing_speed_m_s, force_n, inf)
    return Command(POSITION, stop_gap_m if stops else 0.0, force_n, params.closing_speed_m_s)


def step(params: Any, state: SendAndWatchState, reading: Reading) -> tuple[Command, SendAndWatchState]:
    """Approach, stop at the contact, raise the force in steps, and hold when the fingers are at rest."""
    frame = reading.frame
    phase, outcome, began, began_gap, sent, still = state
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
            phase, sent = SQUEEZE, Raised(sent.force_n, frame.t_s, frame.gap_m)
        elif stopped:
            outcome = ONE_FINGER
    elif outcome == RUNNING:
        if frame.gap_m <= params.closed_gap_m:
            outcome = NOTHING_THERE
        elif rises(sent, params.probing_force_n):
            sent = raised(params, sent, frame.t_s, params.probing_force_n)
            if sent.since_t_s == frame.t_s:
                still = RestState(frame.t_s, frame.gap_m)
        elif rests:
            phase, outcome = HOLD, STEADY
    if outcome == RUNNING and frame.t_s - began > params.timeout_s:
        outcome = NOTHING_THERE if phase == APPROACH else NEVER_STEADY
    return command_of(params, sent), SendAndWatchState(
        phase=phase, outcome=outcome, began_t_s=began, began_gap_m=began_gap, sent=sent, still=still
    )


class SendAndWatchController(Controller[SendAndWatchConfig]):
    """For a gripper that closes by itself: sends target, speed and force, and watches."""

    commands = ("position",)
    alternatives = ("force", "velocity")
    becomes: ClassVar[Mapping[str, str]] = {
        "position": f"the closed position at the closing speed with {STEPS}",
        "velocity": f"the closing speed with {STEPS}",
        "force": f"{STEPS}, at the closing speed",
    }
    step = staticmethod(step)

    @property
    def requires(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """The gap, and the forces of the pads if these tell the contact."""
        pads = (Channel("force_left", "N"), Channel("force_right", "N")) if self.config.pads else ()
        return (Channel("gap", "m"), *pads)

    def asked_force_n(self) -> float:
        """Return the probing force (N)."""
        return float(self.config.probing_force_n)

    def gentlest_force_n(self) -> float:
        """Return the force of the approach (N)."""
        return float(approaching(self.config).force_n)

    def asked_speed_m_s(self) -> float:
        """Return the closing speed (m/s)."""
        return float(self.config.closing_speed_m_s)

    def asked_interval_s(self) -> float:
        """Return the time of a step (s)."""
        return float(self.config.step_time_s)

    def contact_force_n(self) -> float:
        """Return the contact force (N)."""
        return float(self.config.contact_force_n)

    def init(self) -> SendAndWatchState:
        """Return the state before the first tick."""
        return SendAndWatchState(
            phase=APPROACH,
            outcome=RUNNING,
            began_t_s=nan,
            began_gap_m=nan,
            sent=approaching(self.params()),
            still=RestState(0.0, 0.0),
        )
