"""The guard between a controller and a gripper: it limits commands, and stops the grasp if a command is not a number.

It applies the limits of effort and speed of the gripper and of the command, turns NaN into a stop, and keeps the first
closing of a real gripper slow and weak until a contact was detected. It counts the ticks in which it changes a value,
or lowers a limit that the command gives.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from math import fsum, inf
from typing import Any, Final, NamedTuple

from graspsense.core.control.contact import either_touches
from graspsense.core.values.errors import FAILURES, named, place_of
from graspsense.core.values.signals import (
    CLOSING,
    EFFORT,
    FORCE,
    POSITION,
    RUNNING,
    STEADY,
    VELOCITY,
    Command,
    Frame,
    Phase,
    Reading,
)


class GuardParams(NamedTuple):
    """Limits in N and m/s; `first_*` apply until the force on a pad reaches `contact_force_n` (`inf`: no limit)."""

    effort_limit_n: float
    speed_limit_m_s: float
    first_effort_n: float
    first_speed_m_s: float
    contact_force_n: float


class GuardState(NamedTuple):
    """Whether a contact was detected, in how many ticks the guard acted, and whether it stopped the grasp."""

    contact_seen: int
    acted: int
    stopped: int


def limits_without_contact(params: GuardParams, state: GuardState) -> tuple[float, float]:
    """Return the limits of effort (N) and speed (m/s) within which the guard changes nothing while no force changes."""
    if state.contact_seen == 1:
        return params.effort_limit_n, params.speed_limit_m_s
    return min(params.effort_limit_n, params.first_effort_n), min(
        params.speed_limit_m_s, params.first_speed_m_s
    )


def guard(
    params: GuardParams, state: GuardState, frame: Frame, command: Command
) -> tuple[Command, GuardState]:
    """Return the limited command, and the state of the guard.

    An effort in the direction in which the gap already moves at the speed limit becomes 0, so that friction brakes.
    """
    kind, value, effort_limit, speed_limit = command
    contact_seen, acted, stopped = state
    # A limit of NaN fails this comparison, remains NaN, and stops the grasp below.
    if params.effort_limit_n < effort_limit:
        effort_limit = params.effort_limit_n
    if params.speed_limit_m_s < speed_limit:
        speed_limit = params.speed_limit_m_s
    if contact_seen == 0:
        if either_touches(frame.force_left_n, frame.force_right_n, params.contact_force_n):
            contact_seen = 1
        else:
            if params.first_effort_n < effort_limit:
                effort_limit = params.first_effort_n
            if params.first_speed_m_s < speed_limit:
                speed_limit = params.first_speed_m_s
    # An unknown kind, or a position out of reach, is treated like NaN.
    is_known = EFFORT <= kind <= FORCE and not (kind == POSITION and value == inf)
    if stopped == 1 or value != value or not (effort_limit >= 0.0 and speed_limit >= 0.0 and is_known):
        halt = Command(EFFORT, 0.0, params.effort_limit_n, params.speed_limit_m_s)
        return halt, GuardState(contact_seen, acted + 1, 1)

    asked = value
    lowered = False
    if kind == EFFORT:
        if value > effort_limit:
            value = effort_limit
        elif value < -effort_limit:
            value = -effort_limit
        velocity = frame.velocity_m_s
        if (value > 0.0 and -velocity > speed_limit) or (value < 0.0 and velocity > speed_limit):
            value = 0.0
    elif kind == VELOCITY:
        value = min(max(value, -speed_limit), speed_limit)
        lowered = effort_limit < command.effort_limit_n < inf
    elif kind == FORCE:
        value = min(max(value, 0.0), effort_limit)
        lowered = speed_limit < command.speed_limit_m_s < inf
    else:
        value = max(value, 0.0)
        lowered = effort_limit < command.effort_limit_n < inf or speed_limit < command.speed_limit_m_s < inf
    if value != asked or lowered:
        acted += 1
    elif kind == EFFORT:
        # The value is within its limits, which have no further meaning for an effort.
        if contact_seen != state.contact_seen:
            state = GuardState(contact_seen, acted, 0)
        return command, state
    if contact_seen != state.contact_seen or acted != state.acted:
        state = GuardState(contact_seen, acted, 0)
    return Command(kind, value, effort_limit, speed_limit), state


_PHASES: Final = frozenset(Phase)
Step = Callable[[Any, Any, Reading], tuple[Command, Any]]


class StepFailed(Exception):
    """A controller whose step raised an exception, or returned what is no command or no state."""


def with_plain_commands(step: Step) -> Step:
    """Return the step of a controller, run by the interpreter, with commands of plain numbers for the guard to compare.

    A controller is the code of others. A subclass of float, as numpy has one, can define what `<` means. The step
    raises StepFailed where the controller raises, or returns anything but a Command of numbers and a state. While the
    fingers are to close or hold, the phase of the state is one of a controller: the runner opens the fingers.
    """
    name = f"{getattr(step, '__module__', '')}.{getattr(step, '__qualname__', step)}"

    def plain_step(params: Any, state: Any, reading: Reading) -> tuple[Command, Any]:
        try:
            command, state = step(params, state, reading)
            phase, outcome = state.phase, state.outcome
            if phase not in CLOSING and (outcome in (RUNNING, STEADY) or phase not in _PHASES):
                raise ValueError(f"the phase {phase} of its state is none of APPROACH, SQUEEZE and HOLD")
            kind, value, effort_limit, speed_limit = command
            if (
                type(command) is Command
                and type(kind) is int
                and type(value) is float
                and type(effort_limit) is float
                and type(speed_limit) is float
            ):
                return command, state
            if not isinstance(kind, int) and not hasattr(kind, "__index__"):
                raise TypeError(
                    f"the kind of the command is {kind!r}; EFFORT, VELOCITY, POSITION, FORCE are numbers"
                )
            numbers = _number(value), _number(effort_limit), _number(speed_limit)
            return Command(int.__int__(operator.index(kind)), *numbers), state
        except FAILURES as error:
            raise StepFailed(
                f"{name} of the controller failed: {named(error)}{place_of(error)}. It takes (params, state, "
                "reading) and returns (Command, state)"
            ) from error

    return plain_step


def _number(value: Any) -> float:
    # The method of float itself, as that of int above, since that of a subclass can return anything.
    # Not `float`, which takes text for a number too.
    return float.__float__(value) if isinstance(value, float) else fsum((value,))
