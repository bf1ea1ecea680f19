"""Velocity control: a PI loop on the rate of the gap, with the authors' gains.

On its own it keeps its speed after contact by raising its effort, and crushes what it holds (section III.B of
the paper); the hybrid controller uses it only until both fingers touch.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, ClassVar, Literal

from attrs import frozen

from graspsense.plugin_api import (
    POSITION,
    VELOCITY,
    Command,
    Reading,
    setting,
)
from graspsense.plugins.controllers.supervision import (
    EVENTS,
    LawState,
    SupervisedController,
    SupervisionConfig,
    events_of,
    free_begin,
    free_end,
    law_numbers,
    law_state,
    not_begun,
    supervise,
)
from graspsense.simulator_api import FreeMotion, params_of


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


def closing_effort(params: Any, integral_n: float, velocity_m_s: float, dt_s: float) -> tuple[float, float]:
    """Return the effort (N) of the velocity loop, and its integral (N) after this tick.

    `params` has the numbers of `VelocityLoopConfig`.
    """
    limit = params.integral_limit_n
    error = params.closing_speed_m_s + velocity_m_s
    integral_n += (params.integral_gain_n_m * dt_s) * error
    if integral_n > limit:
        integral_n = limit
    elif integral_n < -limit:
        integral_n = -limit
    return params.velocity_gain_n_s_m * error + integral_n, integral_n


def step(params: Any, state: LawState, reading: Reading) -> tuple[Command, LawState]:
    """Close at the given speed against any resistance. The law keeps the integral of the velocity loop."""
    frame = reading.frame
    progress = supervise(params, state.progress, frame, state.progress.still)
    value, integral = closing_effort(params, state.effort_n, frame.velocity_m_s, frame.dt_s)
    speed = inf
    if params.sends == VELOCITY:
        value = -params.closing_speed_m_s
    elif params.sends == POSITION:
        value, speed = 0.0, params.closing_speed_m_s
    return Command(params.sends, value, inf, speed), law_state(
        progress, integral, events_of(state.progress, progress)
    )


def free_command(
    params: Any, integral_n: float, gap_m: float, velocity_m_s: float, dt_s: float
) -> tuple[float, float]:
    """Return the effort and the integral of a tick of free motion."""
    return closing_effort(params, integral_n, velocity_m_s, dt_s)


class VelocityController(SupervisedController[VelocityConfig]):
    """Closes at a given speed."""

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

    def params(self) -> Any:
        """Return the numbers of the config, and those of `law_numbers`."""
        return params_of(self.config, **law_numbers(float(self.config.closing_speed_m_s)))

    def init(self) -> LawState:
        """Return the state before the first tick."""
        return law_state(not_begun(), float(self.config.preload_n), 0)
