"""What a controller does in free motion: while only position and speed of the fingers change, and no force does.

A controller may declare it with `Controller.free_motion`, in a form that needs few numbers. A simulator then runs most
ticks of a grasp without composing a reading and without supervision, and gives the same commands and states as `step`.
In a batch it runs many ticks of an approach at once, with the command of each from this law.
A controller without this declaration is called in every tick.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, Final, NamedTuple

from attrs import frozen

from graspsense.core.values.signals import Frame


class FreeLimits(NamedTuple):
    """Free motion lasts while the gap is larger than `gap_m` (m), and not beyond the time `until_s` (s)."""

    gap_m: float
    until_s: float


NOT_FREE: Final = FreeLimits(inf, -inf)
"""The limits of a state in which the controller does not follow its law of free motion."""


@frozen
class FreeMotion:
    """The law of a controller in free motion: three module functions in the subset of Python that numba compiles.

    They describe ticks in which the forces and edge forces of the frame are those of the tick before, and the limits
    hold. In these ticks `step` must command an effort without further limits, stay in the phase APPROACH with the
    outcome RUNNING, and tell no event. The conformance checks compare the law with `step`.
    """

    begin: Callable[[Any, Any, Frame], tuple[Any, FreeLimits]]
    """`begin(params, state, frame) -> (memory, limits)`: whether free motion follows the tick of `frame`, after which
    the controller is in `state`. The memory is a float, or a tuple of floats: what the law changes from tick to tick.
    `NOT_FREE` if it does not follow."""
    command: Callable[[Any, Any, float, float, float], tuple[float, Any]]
    """`command(params, memory, gap_m, velocity_m_s, dt_s) -> (effort_n, memory)`: one tick. An effort of NaN says that
    free motion has ended before this tick, which `step` then handles."""
    end: Callable[[Any, Any, Any, float, float], Any]
    """`end(params, state, memory, effort_n, t_s) -> state`: the state after the last of these ticks, given that of
    `begin`, the memory and the effort after the last tick, and its time."""
