"""Hybrid velocity-force control: close gently until both fingers touch, then squeeze (equation 15).

Velocity control until *both* pads are tau_1 over their tared zero, then force control. The authors' code
switches hard to a constant effort, which is the default; a ramp is an option.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import ClassVar, NamedTuple

from attrs import frozen

from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    POSITION,
    VELOCITY,
    Command,
    Controller,
    Frame,
    Reading,
    at_rest,
    setting,
)
from graspsense.plugins.controllers.force import (
    ForceLoop,
    ForceLoopConfig,
    force_loop,
    settling,
    squeezing_effort,
)
from graspsense.plugins.controllers.own_loop import (
    STEPS,
    OwnLoop,
    OwnLoopConfig,
    Raised,
    approaching,
    own_loop,
    raised,
    rises,
)
from graspsense.plugins.controllers.supervision import (
    EVENTS,
    LAW_CHANNELS,
    GraspProgress,
    Supervision,
    SupervisionConfig,
    events_of,
    free_limits,
    not_begun,
    not_resting,
    supervise,
    supervision,
)
from graspsense.plugins.controllers.velocity import (
    VelocityLoop,
    VelocityLoopConfig,
    closing_effort,
    kind_sent,
    velocity_loop,
)
from graspsense.simulator_api import NOT_FREE, FreeLimits, FreeMotion


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


class HybridParams(NamedTuple):
    """Numbers of the law; `kind` is the command kind that it sends."""

    velocity: VelocityLoop
    kind: int
    force: ForceLoop
    supervision: Supervision
    ramp_s: float
    own: OwnLoop


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


def step(params: HybridParams, state: HybridState, reading: Reading) -> tuple[Command, HybridState]:
    """Control the velocity until both pads touch, then the force."""
    frame = reading.frame
    progress_so_far = state.progress
    sent = state.sent
    if params.kind == POSITION and rises(sent, params.force.probing_force_n):
        progress_so_far = not_resting(progress_so_far, frame)
    progress = supervise(params.supervision, progress_so_far, frame)
    _, _, _, integral, force_effort, approach_effort, contact_t, _, _ = state
    if progress.phase == APPROACH:
        effort, integral = closing_effort(params.velocity, integral, frame.velocity_m_s, frame.dt_s)
        approach_effort = effort
        contact_t = frame.t_s
        if params.kind == POSITION:  # the fingers stop where both pads touch
            sent = Raised(sent.force_n, frame.t_s, frame.gap_m)
    else:
        # A gripper that closes by itself is corrected when its own loop has come to rest.
        if params.kind != POSITION or (
            not rises(sent, params.force.probing_force_n)
            and at_rest(progress.still, frame.t_s, params.supervision.rest_window_s)
        ):
            force_effort = squeezing_effort(params.force, force_effort, frame)
        effort = force_effort
        elapsed = frame.t_s - contact_t
        if elapsed < params.ramp_s:
            effort = approach_effort + (effort - approach_effort) * (elapsed / params.ramp_s)
        sent = raised(params.own, sent, frame.t_s, params.force.probing_force_n)
    command = Command(EFFORT, effort, inf, inf)
    if params.kind == VELOCITY:
        limit = inf if progress.phase == APPROACH else effort
        command = Command(VELOCITY, -params.velocity.closing_speed_m_s, limit, inf)
    elif params.kind == POSITION:
        command = own_command(params, progress.phase, sent, effort)
    return command, HybridState(
        progress.phase,
        progress.outcome,
        progress,
        integral,
        force_effort,
        approach_effort,
        contact_t,
        sent,
        events_of(state.progress, progress),
    )


def own_command(params: HybridParams, phase: int, sent: Raised, effort_n: float) -> Command:
    """Return what a gripper is sent that closes by itself; its force follows the loop once it has been raised."""
    force, stops = sent.force_n, phase != APPROACH and sent.stop_gap_m == sent.stop_gap_m
    if phase != APPROACH and not stops and force >= params.force.probing_force_n:
        force = effort_n
    return Command(POSITION, sent.stop_gap_m if stops else 0.0, force, params.velocity.closing_speed_m_s)


def free_begin(params: HybridParams, state: HybridState, frame: Frame) -> tuple[float, FreeLimits]:
    """Begin free motion: its memory is the integral of the velocity loop."""
    limits = free_limits(params.supervision, state.progress) if params.kind == EFFORT else NOT_FREE
    return state.integral_n, limits


def free_command(
    params: HybridParams, integral_n: float, gap_m: float, velocity_m_s: float, dt_s: float
) -> tuple[float, float]:
    """Return the effort and the integral of a tick of free motion."""
    return closing_effort(params.velocity, integral_n, velocity_m_s, dt_s)


def free_end(
    params: HybridParams, state: HybridState, integral_n: float, effort_n: float, t_s: float
) -> HybridState:
    """Return the state after free motion."""
    phase, outcome, progress, _, force_effort, _, _, sent, _ = state
    return HybridState(phase, outcome, progress, integral_n, force_effort, effort_n, t_s, sent, 0)


class HybridController(Controller[HybridConfig]):
    """The controller of the paper, and the default."""

    requires = LAW_CHANNELS
    commands = ("effort",)
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
        config = self.config
        return float(max(config.probing_force_n, config.approach_force_n if self._own_loop else 0.0))

    def gentlest_force_n(self) -> float:
        """Return the probing force (N), or that of the approach where one is sent."""
        return float(self.config.approach_force_n if self._own_loop else self.config.probing_force_n)

    def asked_interval_s(self) -> float | None:
        """Return the time of a step of the force (s), where it is raised in steps."""
        return float(self.config.step_time_s) if self._own_loop else None

    @property
    def _own_loop(self) -> bool:
        return bool(self.config.sends == "position")

    def asked_speed_m_s(self) -> float:
        """Return the closing speed (m/s)."""
        return float(self.config.closing_speed_m_s)

    def contact_force_n(self) -> float:
        """Return the contact force (N) of the supervision."""
        return float(self.config.contact_force_n)

    def params(self) -> HybridParams:
        """Return the parameters of the law."""
        return HybridParams(
            velocity=velocity_loop(self.config),
            kind=kind_sent(self.config),
            force=force_loop(self.config),
            supervision=supervision(
                self.config, slowest_m_s=self.config.closing_speed_m_s, **settling(self.config)
            ),
            ramp_s=float(self.config.ramp_s),
            own=own_loop(self.config),
        )

    def init(self) -> HybridState:
        """Return the state before the first tick."""
        progress = not_begun()
        return HybridState(
            progress.phase,
            progress.outcome,
            progress,
            float(self.config.preload_n),
            float(self.config.probing_force_n),
            0.0,
            0.0,
            approaching(own_loop(self.config)),
            0,
        )
