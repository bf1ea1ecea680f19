"""Control laws that no gripper should obey: NaN, huge, oscillating, and never ending commands of any kind."""

from __future__ import annotations

from math import inf, nan
from typing import Any, Final, NamedTuple

from graspsense.core.components.roles import Controller
from graspsense.core.values.signals import (
    APPROACH,
    EFFORT,
    FORCE,
    HOLD,
    POSITION,
    RUNNING,
    SQUEEZE,
    VELOCITY,
    Command,
    Reading,
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


def step(params: tuple[str, int], state: HostileState, reading: Reading) -> tuple[Command, HostileState]:
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
    step = staticmethod(step)

    def params(self) -> Any:
        """Return its name and the kind of command."""
        return self.config

    def init(self) -> HostileState:
        """Return the state before the first tick."""
        return HostileState(APPROACH, RUNNING, 0)
