"""Force control: a constant effort, as in the authors' code, or a closed loop on the force of the pads.

Driven from an open gripper it arrives at full speed: the impact of Fig. 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import ClassVar, Literal, NamedTuple

from attrs import frozen

from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    FORCE,
    POSITION,
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
class ForceLoopConfig:
    """The target of the squeeze, and the control loop."""

    probing_force_n: float = setting(
        default=20.0,
        unit="N",
        above=0.0,
        plausible=(0.1, 200.0),
        meaning="The effort of the squeeze; with loop = closed, the force on each pad.",
    )
    loop: Literal["open", "closed"] = setting(
        default="open",
        meaning="open: a constant effort, as in the authors' code. closed: an integral loop on the pads' mean force.",
    )
    force_gain_1_s: float = setting(
        default=4.0,
        unit="1/s",
        minimum=0.0,
        meaning="Closed loop only: rate of the effort per newton of error; slow compared with a cell image every 41"
        " ms.",
    )
    force_tolerance_n: float = setting(
        default=0.3,
        unit="N",
        above=0.0,
        plausible=(0.01, 20.0),
        meaning="Closed loop only: largest error of the mean force at steady state (as in pr2_gripper_sensor).",
    )
    effort_limit_n: float = setting(
        default=100.0,
        unit="N",
        above=0.0,
        plausible=(1.0, 500.0),
        meaning="Closed loop only: upper limit of the effort; the lower limit is 0.",
    )


@frozen(kw_only=True, slots=False)
class ForceConfig(SupervisionConfig, ForceLoopConfig):
    """Settings of the force controller."""

    sends: Literal["effort", "position", "force"] = setting(
        default="effort",
        meaning="What is commanded. position and force are for a gripper that closes by itself: the closed position "
        "with the effort as its force, or the effort as a force.",
    )


class ForceLoop(NamedTuple):
    """The parameters of `ForceLoopConfig`; `closed` is 0 or 1."""

    probing_force_n: float
    closed: int
    force_gain_1_s: float
    effort_limit_n: float


def force_loop(config: ForceLoopConfig) -> ForceLoop:
    """Return the parameters of this config."""
    return ForceLoop(
        probing_force_n=float(config.probing_force_n),
        closed=1 if config.loop == "closed" else 0,
        force_gain_1_s=float(config.force_gain_1_s),
        effort_limit_n=float(config.effort_limit_n),
    )


def squeezing_effort(loop: ForceLoop, effort_n: float, frame: Frame) -> float:
    """Return the effort (N) of this tick, given that of the tick before."""
    if loop.closed == 0:
        return loop.probing_force_n
    error = loop.probing_force_n - 0.5 * (frame.force_left_n + frame.force_right_n)
    effort_n += loop.force_gain_1_s * error * frame.dt_s
    return min(max(effort_n, 0.0), loop.effort_limit_n)


def settling(config: ForceLoopConfig) -> dict[str, float]:
    """Return the target of `supervision` for the force; empty for an open loop."""
    if config.loop == "open":
        return {}
    return {"target_force_n": config.probing_force_n, "force_tolerance_n": config.force_tolerance_n}


class ForceParams(NamedTuple):
    """Parameters of the law; `kind` is the command kind that it sends."""

    loop: ForceLoop
    kind: int
    supervision: Supervision


class ForceState(NamedTuple):
    """State of the law."""

    phase: int
    outcome: int
    progress: GraspProgress
    effort_n: float
    events: int = 0
    """The bits of `EVENTS` in this tick."""


def step(params: ForceParams, state: ForceState, reading: Reading) -> tuple[Command, ForceState]:
    """Close with the probing effort; from contact on, control the force if the loop is closed."""
    frame = reading.frame
    progress = supervise(params.supervision, state.progress, frame)
    effort = params.loop.probing_force_n
    if progress.phase != APPROACH:
        effort = squeezing_effort(params.loop, state.effort_n, frame)
    value, limit = effort, inf
    if params.kind == POSITION:
        value, limit = 0.0, effort
    return Command(params.kind, value, limit, inf), ForceState(
        progress.phase, progress.outcome, progress, effort, events_of(state.progress, progress)
    )


def free_begin(params: ForceParams, state: ForceState, frame: Frame) -> tuple[float, FreeLimits]:
    """Begin free motion, whose effort is constant: its memory is unused."""
    return 0.0, free_limits(params.supervision, state.progress) if params.kind == EFFORT else NOT_FREE


def free_command(
    params: ForceParams, memory: float, gap_m: float, velocity_m_s: float, dt_s: float
) -> tuple[float, float]:
    """Return the effort of a tick of free motion."""
    return params.loop.probing_force_n, memory


def free_end(
    params: ForceParams, state: ForceState, memory: float, effort_n: float, t_s: float
) -> ForceState:
    """Return the state after free motion."""
    return ForceState(state.phase, state.outcome, state.progress, effort_n, 0)


class ForceController(Controller[ForceConfig]):
    """Closes with a constant effort, or squeezes to a given force."""

    requires = LAW_CHANNELS
    commands = ("effort",)
    alternatives = ("position", "force")
    becomes: ClassVar[Mapping[str, str]] = {
        "position": "the closed position with the probing force, at the greatest speed that is allowed",
        "force": "the probing force, at the greatest speed that is allowed",
    }
    step = staticmethod(step)
    events = EVENTS
    free_motion = FreeMotion(free_begin, free_command, free_end)

    def asked_force_n(self) -> float:
        """Return the probing force (N)."""
        return float(self.config.probing_force_n)

    def contact_force_n(self) -> float:
        """Return the contact force (N) of the supervision."""
        return float(self.config.contact_force_n)

    def params(self) -> ForceParams:
        """Return the parameters of the law."""
        return ForceParams(
            loop=force_loop(self.config),
            kind={"effort": EFFORT, "position": POSITION, "force": FORCE}[self.config.sends],
            supervision=supervision(self.config, **settling(self.config)),
        )

    def init(self) -> ForceState:
        """Return the state before the first tick."""
        progress = not_begun()
        return ForceState(progress.phase, progress.outcome, progress, float(self.config.probing_force_n), 0)
