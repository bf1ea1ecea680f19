"""Commands of a controller as plain numbers, so that the comparisons of the guard are those of numbers.

A controller is the code of others. A subclass of float, as numpy has one, can define what `<` means.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from graspsense.core.values.signals import Command, Reading

Step = Callable[[Any, Any, Reading], tuple[Command, Any]]


def with_plain_commands(step: Step) -> Step:
    """Return the step of a controller, run by the interpreter, with commands of plain numbers.

    It raises TypeError or ValueError where a command is not made of numbers.
    """

    def plain_step(params: Any, state: Any, reading: Reading) -> tuple[Command, Any]:
        command, state = step(params, state, reading)
        kind, value, effort_limit, speed_limit = command
        if (
            type(command) is Command
            and type(kind) is int
            and type(value) is float
            and type(effort_limit) is float
            and type(speed_limit) is float
        ):
            return command, state
        return Command(_integer(kind), _number(value), _number(effort_limit), _number(speed_limit)), state

    return plain_step


def _integer(value: Any) -> int:
    return int.__int__(value) if isinstance(value, int) else operator.index(value)


def _number(value: Any) -> float:
    # The method of float itself, since that of a subclass can return anything.
    return float.__float__(value) if isinstance(value, float) else float(value)
