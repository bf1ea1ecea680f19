"""Control laws that no gripper should obey: NaN, huge, oscillating, and never ending commands of any kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
LARGEST: Final[Mapping[int, float]] = {EFFORT: 1e308, FORCE: 1e308, VELOCITY: -1e308, POSITION: 0.0}
"""The value of each kind of command that closes the fingers as hard as it can."""


class HostileParams(NamedTuple):
    """The kind of command, and the value of it that closes."""

    kind: int
    largest: float


class HostileState(NamedTuple):
    """The phase that the law claims, and its number of ticks; it never ends."""

    phase: int
    outcome: int
    ticks: int


Law = Callable[[HostileParams, HostileState, Reading], tuple[Command, HostileState]]


def _counted(state: HostileState, phase: int) -> HostileState:
    return HostileState(phase, RUNNING, state.ticks + 1)


def not_a_number(
    params: HostileParams, state: HostileState, reading: Reading
) -> tuple[Command, HostileState]:
    """Command nothing, then NaN."""
    value = nan
    if state.ticks < CALM_TICKS:
        value = reading.frame.gap_m if params.kind == POSITION else 0.0
    return Command(params.kind, value, inf, inf), _counted(state, APPROACH)


def huge(params: HostileParams, state: HostileState, reading: Reading) -> tuple[Command, HostileState]:
    """Close as hard as the numbers allow, and call it an approach."""
    return Command(params.kind, params.largest, inf, inf), _counted(state, APPROACH)


def oscillating(params: HostileParams, state: HostileState, reading: Reading) -> tuple[Command, HostileState]:
    """Close and open as hard as the numbers allow, in turn, and call it a squeeze."""
    closes = state.ticks % PERIOD_TICKS < 0.75 * PERIOD_TICKS
    opposite = reading.frame.gap_m if params.kind == POSITION else -params.largest
    return Command(params.kind, params.largest if closes else opposite, inf, inf), _counted(state, SQUEEZE)


def never_ending(
    params: HostileParams, state: HostileState, reading: Reading
) -> tuple[Command, HostileState]:
    """Close as hard as the numbers allow, and call it a hold that does not end."""
    return Command(params.kind, params.largest, inf, inf), _counted(state, HOLD)


class HostileController(Controller[int]):
    """A law that never ends; its config is the number of a kind of command."""

    requires = ()
    commands = ("effort", "velocity", "position", "force")

    def params(self) -> HostileParams:
        """Return the kind and the value that closes."""
        return HostileParams(self.config, LARGEST[self.config])

    def init(self) -> HostileState:
        """Return the state before the first tick."""
        return HostileState(APPROACH, RUNNING, 0)


def _obeying(law: Law) -> type[HostileController]:
    """Return a controller with this law."""
    return type("Hostile", (HostileController,), {"step": staticmethod(law)})


HOSTILE: Final[Mapping[str, Callable[[int], Controller[Any]]]] = {
    "NaN": _obeying(not_a_number),
    "1e308": _obeying(huge),
    "oscillating": _obeying(oscillating),
    "never ending": _obeying(never_ending),
}
"""The laws by name; each is called with the number of a kind of command."""
