"""The greatest effort of a grasp, which follows from the force that was asked for, not from what the motor can do."""

from __future__ import annotations

from math import inf
from typing import Final

from graspsense.core.components.roles import Controller
from graspsense.core.components.run_config import RunConfig
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.signals import EFFORT, FORCE, Command

FORCE_N: Final = 20.0
"""The force that is assumed for a controller that asks for none: the probing force of the paper's experiments."""
MARGIN: Final = 1.25
"""The ceiling over the asked force, friction apart: a closed loop overshoots, and motors are off by a fifth."""


def effort_ceiling_n(info: DeviceInfo, controller: Controller[object], run: RunConfig) -> float:
    """Return the greatest effort (N) with which the fingers may close in this grasp.

    It is `run.effort_ceiling_n` where that is set. Otherwise it is the force that the controller asks for, with a
    margin of a quarter, plus the friction of the drive.
    """
    if run.effort_ceiling_n is not None:
        return min(run.effort_ceiling_n, info.effort_limit_n)
    asked_n = controller.asked_force_n()
    # What is not a number, or below zero, is no force.
    force_n = asked_n if asked_n is not None and 0.0 <= asked_n < inf else FORCE_N
    friction_n = info.friction_n if 0.0 <= info.friction_n < inf else 0.0
    return min(MARGIN * force_n + friction_n, info.effort_limit_n)


def asked_effort_n(command: Command) -> float:
    """Return the effort (N) that a command may use: that of an effort or a force, otherwise its limit."""
    return command.value if command.kind in (EFFORT, FORCE) else command.effort_limit_n


def limited(command: Command, closing_n: float, opening_n: float) -> Command:
    """Return the command with at most these efforts (N) in closing and in opening direction."""
    kind, value, effort_limit_n, speed_limit_m_s = command
    if kind == EFFORT:
        value = min(max(value, -opening_n), closing_n)
    elif kind == FORCE:
        value = min(value, closing_n)
    else:
        effort_limit_n = min(effort_limit_n, closing_n)
    return Command(kind, value, effort_limit_n, speed_limit_m_s)
