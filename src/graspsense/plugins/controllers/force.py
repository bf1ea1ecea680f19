"""Force control: a constant effort, as in the authors' code, or a closed loop on the force of the pads.

Driven from an open gripper it arrives at full speed: the impact of Fig. 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, ClassVar, Literal

from attrs import frozen

from graspsense.plugin_api import (
    APPROACH,
    POSITION,
    Command,
    Frame,
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


def squeezing_effort(params: Any, effort_n: float, frame: Frame) -> float:
    """Return the effort (N) of this tick, given that of the tick before.

    `params` has the numbers of `ForceLoopConfig`, and those of `force_numbers`.
    """
    asked_n: float = params.probing_force_n
    if params.closed == 0:
        return asked_n
    most_n: float = params.effort_limit_n
    error = asked_n - 0.5 * (frame.force_left_n + frame.force_right_n)
    effort_n += params.force_gain_1_s * error * frame.dt_s
    return min(max(effort_n, 0.0), most_n)


def force_numbers(config: ForceLoopConfig, slowest_m_s: float = 0.0) -> dict[str, float]:
    """Return what a law of the force adds to the numbers of its config: `law_numbers`, and whether the loop is closed.

    With a closed loop the force has a target. `closed` is 1 or 0.
    """
    if config.loop == "open":
        return {**law_numbers(slowest_m_s), "closed": 0}
    numbers = law_numbers(slowest_m_s, float(config.probing_force_n), float(config.force_tolerance_n))
    return {**numbers, "closed": 1}


def step(params: Any, state: LawState, reading: Reading) -> tuple[Command, LawState]:
    """Close with the probing effort; from contact on, control the force if the loop is closed."""
    frame = reading.frame
    progress = supervise(params, state.progress, frame, state.progress.still)
    effort = params.probing_force_n
    if progress.phase != APPROACH:
        effort = squeezing_effort(params, state.effort_n, frame)
    value, limit = effort, inf
    if params.sends == POSITION:
        value, limit = 0.0, effort
    return Command(params.sends, value, limit, inf), law_state(
        progress, effort, events_of(state.progress, progress)
    )


def free_command(
    params: Any, memory: float, gap_m: float, velocity_m_s: float, dt_s: float
) -> tuple[float, float]:
    """Return the effort of a tick of free motion."""
    return params.probing_force_n, params.probing_force_n


class ForceController(SupervisedController[ForceConfig]):
    """Closes with a constant effort, or squeezes to a given force."""

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

    def params(self) -> Any:
        """Return the numbers of the config, and those of `force_numbers`."""
        return params_of(self.config, **force_numbers(self.config))

    def init(self) -> LawState:
        """Return the state before the first tick."""
        return law_state(not_begun(), float(self.config.probing_force_n), 0)
