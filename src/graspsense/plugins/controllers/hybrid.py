"""Hybrid velocity-force control: close gently until both fingers touch, then squeeze (equation 15).

Velocity control until *both* pads are tau_1 over their tared zero, then force control. The authors' code
switches hard to a constant effort, which is the default; a ramp is an option.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, ClassVar, NamedTuple

from attrs import frozen

from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    POSITION,
    VELOCITY,
    Command,
    Frame,
    Reading,
    RestState,
    at_rest,
    setting,
)
from graspsense.plugins.controllers.force import (
    ForceLoopConfig,
    force_numbers,
    squeezing_effort,
)
from graspsense.plugins.controllers.own_loop import (
    STEPS,
    OwnLoopConfig,
    Raised,
    approaching,
    raised,
    rises,
)
from graspsense.plugins.controllers.supervision import (
    EVENTS,
    GraspProgress,
    SupervisedController,
    SupervisionConfig,
    events_of,
    free_limits,
    not_begun,
    supervise,
)
from graspsense.plugins.controllers.velocity import (
    VelocityLoopConfig,
    closing_effort,
    free_command,
)
from graspsense.simulator_api import FreeLimits, FreeMotion, params_of


@frozen(kw_only=True, slots=False)
class HybridConfig(SupervisionConfig, ForceLoopConfig, VelocityLoopConfig, OwnLoopConfig):
    """Settings of the hybrid controller."""

    ramp_s: float = setting(
        default=0.0,
        unit="s",
        minimum=0.0,
        plausible=(0.0, 10.0),
        meaning="Time over which the effort changes from that of the velocity loop to that of the force law (0: at "
        "once).",
    )


class HybridState(NamedTuple):
    """State of the law. `approach_effort_n` is the last effort of the velocity loop, at which a ramp starts."""

    phase: int
    outcome: int
    progress: GraspProgress
    integral_n: float
    force_effort_n: float
    approach_effort_n: float
    approached_t_s: float
    """Time of the last tick of the velocity loop, at which the ramp starts."""
    sent: Raised
    """What is sent to a gripper that closes by itself."""
    events: int = 0
    """The bits of `EVENTS` in this tick."""


def step(params: Any, state: HybridState, reading: Reading) -> tuple[Command, HybridState]:
    """Control the velocity until both pads touch, then the force."""
    frame = reading.frame
    still = state.progress.still
    sent = state.sent
    if params.sends == POSITION and rises(sent, params.probing_force_n):
        still = RestState(frame.t_s, frame.gap_m)
    progress = supervise(params, state.progress, frame, still)
    _, _, _, integral, force_effort, approach_effort, contact_t, _, _ = state
    if progress.phase == APPROACH:
        effort, integral = closing_effort(params, integral, frame.velocity_m_s, frame.dt_s)
        approach_effort = effort
        contact_t = frame.t_s
        if params.sends == POSITION:  # the fingers stop where both pads touch
            sent = Raised(sent.force_n, frame.t_s, frame.gap_m)
    else:
        # A gripper that closes by itself is corrected when its own loop has come to rest.
        if params.sends != POSITION or (
            not rises(sent, params.probing_force_n)
            and at_rest(progress.still, frame.t_s, params.rest_window_s)
        ):
            force_effort = squeezing_effort(params, force_effort, frame)
        effort = force_effort
        elapsed = frame.t_s - contact_t
        if 0.0 <= elapsed < params.ramp_s:  # not where the clock of the gripper went back
            effort = approach_effort + (effort - approach_effort) * (elapsed / params.ramp_s)
        sent = raised(params, sent, frame.t_s, params.probing_force_n)
    command = Command(EFFORT, effort, inf, inf)
    if params.sends == VELOCITY:
        limit = inf if progress.phase == APPROACH else effort
        command = Command(VELOCITY, -params.closing_speed_m_s, limit, inf)
    elif params.sends == POSITION:
        command = own_command(params, progress.phase, sent, effort)
    return command, HybridState(
        phase=progress.phase,
        outcome=progress.outcome,
        progress=progress,
        integral_n=integral,
        force_effort_n=force_effort,
        approach_effort_n=approach_effort,
        approached_t_s=contact_t,
        sent=sent,
        events=events_of(state.progress, progress),
    )


def own_command(params: Any, phase: int, sent: Raised, effort_n: float) -> Command:
    """Return what a gripper is sent that closes by itself; its force follows the loop once it has been raised."""
    force, stops = sent.force_n, phase != APPROACH and sent.stop_gap_m == sent.stop_gap_m
    if phase != APPROACH and not stops and force >= params.probing_force_n:
        force = effort_n
    return Command(POSITION, sent.stop_gap_m if stops else 0.0, force, params.closing_speed_m_s)


def free_begin(params: Any, state: HybridState, frame: Frame) -> tuple[float, FreeLimits]:
    """Begin free motion: its memory is the integral of the velocity loop."""
    return state.integral_n, free_limits(params, state.progress)


def free_end(params: Any, state: HybridState, integral_n: float, effort_n: float, t_s: float) -> HybridState:
    """Return the state after free motion."""
    phase, outcome, progress, _, force_effort, _, _, sent, _ = state
    return HybridState(
        phase=phase,
        outcome=outcome,
        progress=progress,
        integral_n=integral_n,
        force_effort_n=force_effort,
        approach_effort_n=effort_n,
        approached_t_s=t_s,
        sent=sent,
        events=0,
    )


class HybridController(SupervisedController[HybridConfig]):
    """The controller of the paper, and the default."""

    alternatives = ("velocity", "position")
    becomes: ClassVar[Mapping[str, str]] = {
        "position": f"the closed position at the closing speed with {STEPS}",
        "velocity": "the closing speed, from the contact on with the probing force",
    }
    step = staticmethod(step)
    events = EVENTS
    free_motion = FreeMotion(free_begin, free_command, free_end)

    def asked_force_n(self) -> float:
        """Return the probing force (N)."""
        return float(self.config.probing_force_n)

    def gentlest_force_n(self) -> float:
        """Return the probing force (N), or that of the approach where one is sent."""
        return float(approaching(self.config).force_n if self._own_loop else self.config.probing_force_n)

    def asked_interval_s(self) -> float | None:
        """Return the time of a step of the force (s), where it is raised in steps."""
        return float(self.config.step_time_s) if self._own_loop else None

    @property
    def _own_loop(self) -> bool:
        return bool(self.config.sends == "position")

    def asked_speed_m_s(self) -> float:
        """Return the closing speed (m/s)."""
        return float(self.config.closing_speed_m_s)

    def params(self) -> Any:
        """Return the numbers of the config, and those of `force_numbers`."""
        return params_of(self.config, **force_numbers(self.config, float(self.config.closing_speed_m_s)))

    def init(self) -> HybridState:
        """Return the state before the first tick."""
        progress = not_begun()
        return HybridState(
            phase=progress.phase,
            outcome=progress.outcome,
            progress=progress,
            integral_n=float(self.config.preload_n),
            force_effort_n=float(self.config.probing_force_n),
            approach_effort_n=0.0,
            approached_t_s=0.0,
            sent=approaching(self.params()),
            events=0,
        )
