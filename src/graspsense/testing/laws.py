"""The control laws that drive a gripper under check: a slow and weak one, and some that no gripper should obey.

Those command NaN, huge, oscillating and never ending values, by any kind of command.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any, Final, NamedTuple

from graspsense.core.components.entries import KINDS
from graspsense.core.components.roles import Controller
from graspsense.core.control.contact import RestState, at_rest, update_rest
from graspsense.core.values.signals import (
    APPROACH,
    EFFORT,
    FORCE,
    HOLD,
    NOTHING_THERE,
    POSITION,
    RUNNING,
    SQUEEZE,
    STEADY,
    VELOCITY,
    Command,
    Frame,
    Reading,
)

SPEED_M_S: Final = 0.01
EFFORT_N: Final = 12.0
EFFORT_RATE_N_S: Final = 15.0
"""Rate at which an effort command rises until the fingers move. They move at the breakaway effort."""
FORCE_N: Final = 2.0
REST_SPEED_M_S: Final = 5e-4
REST_S: Final = 0.5
LONGEST_S: Final = 6.0


class GentleParams(NamedTuple):
    """The kind of command."""

    kind: int


class GentleState(NamedTuple):
    """The start of the grasp, the last gap, and the state of rest."""

    phase: int
    outcome: int
    begun_t_s: float
    gap_m: float
    before_m: float
    still: RestState


def closing(kind: int, seconds: float, before_m: float, frame: Frame) -> Command:
    """Return the command of this kind that closes gently, this many seconds after the start.

    `before_m` is the gap of the previous frame. The speed is computed from gaps, because the velocity channel of the
    gripper is not yet checked.
    """
    if kind == VELOCITY:
        return Command(VELOCITY, -SPEED_M_S, EFFORT_N, inf)
    if kind == POSITION:
        return Command(POSITION, 0.0, EFFORT_N, SPEED_M_S)
    if kind == FORCE:
        return Command(FORCE, FORCE_N, EFFORT_N, SPEED_M_S)
    effort = min(EFFORT_RATE_N_S * seconds, EFFORT_N)
    if before_m - frame.gap_m > SPEED_M_S * frame.dt_s:
        effort = 0.0
    return Command(EFFORT, effort, inf, inf)


def step(params: GentleParams, state: GentleState, reading: Reading) -> tuple[Command, GentleState]:
    """Close until the gap is at rest, or for six seconds."""
    frame = reading.frame
    begun, gap, still = state.begun_t_s, state.gap_m, state.still
    if begun != begun:
        begun, gap, still = frame.t_s, frame.gap_m, RestState(frame.t_s, frame.gap_m)
    still = update_rest(still, frame.t_s, frame.gap_m, REST_SPEED_M_S, REST_S)
    phase, outcome = state.phase, state.outcome
    if phase == APPROACH and gap - frame.gap_m > 1e-3:
        phase = SQUEEZE
    if phase == SQUEEZE and at_rest(still, frame.t_s, REST_S):
        phase, outcome = HOLD, STEADY
    elif outcome == RUNNING and frame.t_s - begun > LONGEST_S:
        outcome = NOTHING_THERE
    return closing(params.kind, frame.t_s - begun, state.before_m, frame), GentleState(
        phase=phase, outcome=outcome, begun_t_s=begun, gap_m=gap, before_m=frame.gap_m, still=still
    )


class GentleController(Controller[int]):
    """Closes with one kind of command."""

    step = staticmethod(step)

    def params(self) -> GentleParams:
        """Return the kind."""
        return GentleParams(self.config)

    def init(self) -> GentleState:
        """Return the state before the first tick."""
        return GentleState(
            phase=APPROACH,
            outcome=RUNNING,
            begun_t_s=float("nan"),
            gap_m=float("nan"),
            before_m=float("nan"),
            still=RestState(0.0, 0.0),
        )


def kind_of(accepts: tuple[str, ...]) -> int:
    """Return the kind of command by which to close a gripper that accepts these."""
    for kind in (VELOCITY, POSITION, FORCE, EFFORT):
        if KINDS[kind] in accepts:
            return kind
    raise ValueError(
        "a gripper that accepts no kind of command cannot be closed: give `accepts` in its entry"
    )


CALM_TICKS: Final = 500
"""Ticks of a gentle approach before a law commands NaN."""
PERIOD_TICKS: Final = 200
HOSTILE: Final = {"NaN": APPROACH, "1e308": APPROACH, "oscillating": SQUEEZE, "never ending": HOLD}
"""The laws by what they command, with the phase that each claims to be in."""
LARGEST: Final = {EFFORT: 1e308, FORCE: 1e308, VELOCITY: -1e308, POSITION: 0.0}
"""The value of each kind of command that closes the fingers as hard as it can."""


class HostileState(NamedTuple):
    """The phase that the law claims, and its number of ticks; it never ends."""

    phase: int
    outcome: int
    ticks: int


def hostile_step(
    params: tuple[str, int], state: HostileState, reading: Reading
) -> tuple[Command, HostileState]:
    """Close as hard as the numbers allow; or command nothing and then NaN, or close and open in turn."""
    law, kind = params
    value = LARGEST[kind]
    still = reading.frame.gap_m if kind == POSITION else 0.0
    if law == "NaN":
        value = still if state.ticks < CALM_TICKS else nan
    elif law == "oscillating" and state.ticks % PERIOD_TICKS >= 0.75 * PERIOD_TICKS:
        value = still if kind == POSITION else -value
    return Command(kind, value, inf, inf), HostileState(HOSTILE[law], RUNNING, state.ticks + 1)


class HostileController(Controller[tuple[str, int]]):
    """A law that never ends; its config is its name in `HOSTILE`, and the number of a kind of command."""

    requires = ()
    commands = ("effort", "velocity", "position", "force")
    step = staticmethod(hostile_step)

    def params(self) -> Any:
        """Return its name and the kind of command."""
        return self.config

    def init(self) -> HostileState:
        """Return the state before the first tick."""
        return HostileState(APPROACH, RUNNING, 0)
