"""Velocity control: a PI loop on the rate of the gap, with the authors' gains.

On its own it keeps its speed after contact by raising its effort, and crushes what it holds (section III.B of
the paper); the hybrid controller uses it only until both fingers touch.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import ClassVar, Literal, NamedTuple

from attrs import frozen

from graspsense.plugin_api import (
    EFFORT,
    POSITION,
    VELOCITY,
    Command,
    Controller,
    Frame,
    Reading,
    setting,
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
    supervise,
    supervision,
)
from graspsense.simulator_api import NOT_FREE, FreeLimits, FreeMotion


@frozen(kw_only=True, slots=False)
class VelocityLoopConfig:
    """Gains of the velocity loop: 15000 and 25, with the integral limited to 100 N, as in the authors' code."""

    closing_speed_m_s: float = setting(
        default=0.010, unit="m/s", above=0.0, plausible=(1e-4, 0.2), meaning="Closing speed of the gap."
    )
    velocity_gain_n_s_m: float = setting(
        default=15000.0, unit="N s/m", minimum=0.0, meaning="Effort per error of the speed."
    )
    integral_gain_n_m: float = setting(
        default=25.0, unit="N/m", minimum=0.0, meaning="Effort per error of the gap."
    )
    integral_limit_n: float = setting(
        default=100.0,
        unit="N",
        minimum=0.0,
        plausible=(0.0, 500.0),
        meaning="Largest effort, in either direction, that the integral of the speed error contributes.",
    )
    preload_n: float = setting(
        default=7.0,
        unit="N",
        minimum=0.0,
        plausible=(0.0, 100.0),
        meaning="Initial value of the integral: the Coulomb friction of the gripper (7 N is fed forward in "
        "pr2_gripper_sensor).",
    )
    sends: Literal["effort", "velocity", "position"] = setting(
        default="effort",
        meaning="What is commanded. velocity is for a gripper with a velocity loop of its own, position for one that "
        "closes by itself at this speed: the gains then have no effect.",
    )


@frozen(kw_only=True, slots=False)
class VelocityConfig(SupervisionConfig, VelocityLoopConfig):
    """Settings of the velocity controller."""


class VelocityLoop(NamedTuple):
    """The parameters of `VelocityLoopConfig`."""

    closing_speed_m_s: float
    velocity_gain_n_s_m: float
    integral_gain_n_m: float
    integral_limit_n: float
    preload_n: float


def velocity_loop(config: VelocityLoopConfig) -> VelocityLoop:
    """Return the parameters of this config."""
    return VelocityLoop(
        closing_speed_m_s=float(config.closing_speed_m_s),
        velocity_gain_n_s_m=float(config.velocity_gain_n_s_m),
        integral_gain_n_m=float(config.integral_gain_n_m),
        integral_limit_n=float(config.integral_limit_n),
        preload_n=float(config.preload_n),
    )


def kind_sent(config: VelocityLoopConfig) -> int:
    """Return the command kind of the key `sends`."""
    return {"effort": EFFORT, "velocity": VELOCITY, "position": POSITION}[config.sends]


def closing_effort(
    loop: VelocityLoop, integral_n: float, velocity_m_s: float, dt_s: float
) -> tuple[float, float]:
    """Return the effort (N) of the velocity loop, and its integral (N) after this tick."""
    speed, gain, integral_gain, limit, _ = loop
    error = speed + velocity_m_s
    integral_n += (integral_gain * dt_s) * error
    if integral_n > limit:
        integral_n = limit
    elif integral_n < -limit:
        integral_n = -limit
    return gain * error + integral_n, integral_n


class VelocityParams(NamedTuple):
    """Numbers of the law; `kind` is the command kind that it sends."""

    loop: VelocityLoop
    kind: int
    supervision: Supervision


class VelocityState(NamedTuple):
    """State of the law."""

    phase: int
    outcome: int
    progress: GraspProgress
    integral_n: float
    events: int = 0
    """The bits of `EVENTS` in this tick."""


def step(params: VelocityParams, state: VelocityState, reading: Reading) -> tuple[Command, VelocityState]:
    """Close at the given speed against any resistance."""
    frame = reading.frame
    progress = supervise(params.supervision, state.progress, frame)
    value, integral = closing_effort(params.loop, state.integral_n, frame.velocity_m_s, frame.dt_s)
    speed = inf
    if params.kind == VELOCITY:
        value = -params.loop.closing_speed_m_s
    elif params.kind == POSITION:
        value, speed = 0.0, params.loop.closing_speed_m_s
    return Command(params.kind, value, inf, speed), VelocityState(
        progress.phase, progress.outcome, progress, integral, events_of(state.progress, progress)
    )


def free_begin(params: VelocityParams, state: VelocityState, frame: Frame) -> tuple[float, FreeLimits]:
    """Begin free motion: its memory is the integral."""
    limits = free_limits(params.supervision, state.progress) if params.kind == EFFORT else NOT_FREE
    return state.integral_n, limits


def free_command(
    params: VelocityParams, integral_n: float, gap_m: float, velocity_m_s: float, dt_s: float
) -> tuple[float, float]:
    """Return the effort and the integral of a tick of free motion."""
    return closing_effort(params.loop, integral_n, velocity_m_s, dt_s)


def free_end(
    params: VelocityParams, state: VelocityState, integral_n: float, effort_n: float, t_s: float
) -> VelocityState:
    """Return the state after free motion."""
    return VelocityState(state.phase, state.outcome, state.progress, integral_n, 0)


class VelocityController(Controller[VelocityConfig]):
    """Closes at a given speed."""

    requires = LAW_CHANNELS
    commands = ("effort",)
    alternatives = ("velocity", "position")
    becomes: ClassVar[Mapping[str, str]] = {
        "position": "the closed position at the closing speed with the greatest force that is allowed",
        "velocity": "the closing speed with the greatest force that is allowed",
    }
    step = staticmethod(step)
    events = EVENTS
    free_motion = FreeMotion(free_begin, free_command, free_end)

    def asked_speed_m_s(self) -> float:
        """Return the closing speed (m/s)."""
        return float(self.config.closing_speed_m_s)

    def contact_force_n(self) -> float:
        """Return the contact force (N) of the supervision."""
        return float(self.config.contact_force_n)

    def params(self) -> VelocityParams:
        """Return the parameters of the law."""
        return VelocityParams(
            loop=velocity_loop(self.config),
            kind=kind_sent(self.config),
            supervision=supervision(self.config, slowest_m_s=self.config.closing_speed_m_s),
        )

    def init(self) -> VelocityState:
        """Return the state before the first tick."""
        progress = not_begun()
        return VelocityState(progress.phase, progress.outcome, progress, float(self.config.preload_n), 0)
