"""What a term is: a part of an object's force with everything the simulator has to know of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from attrs import frozen

Law = Callable[[Any, Any, float, float, float], tuple[float, Any]]
"""`law(params, state, d0, d1, h) -> (force, state)`: the compression goes straight from d0 to d1 (m) in h (s)."""

PIECES: Final = 256


class NoState(NamedTuple):
    """The state of a term that remembers nothing."""


class WorkingPoint(NamedTuple):
    """What a grasp does with an object: how far it compresses it, how fast, and for how long."""

    compression_m: float
    speed_m_s: float
    seconds: float


class Rate(NamedTuple):
    """How fast a state of a term goes its own way: `relaxes` (1/s) or `swings` (rad/s)."""

    what: str
    per_s: float


def no_rates(params: Any, at: WorkingPoint) -> tuple[Rate, ...]:
    """Return the rates of a term without states of its own: none."""
    del params, at
    return ()


NO_STATE: Final = NoState()


@frozen(kw_only=True)
class Term:
    """A kind of term: its name in a scene, parameters, law, and state at rest.

    `params` is a named tuple of floats; a field with a default may be left out of a scene. The law is a pure
    function that runs in the interpreter and compiled: floats and named tuples, no closure, no `x**2`. It
    integrates itself, stably however fast its own state is. `rates` says at a working point how fast its states
    are. `positive` names parameters that may not be zero; none may be negative.
    """

    name: str
    summary: str
    params: type[Any]
    law: Law
    at_rest: Any = NO_STATE
    rates: Callable[[Any, WorkingPoint], tuple[Rate, ...]] = no_rates
    positive: tuple[str, ...] = ()
    stiffnesses: tuple[str, ...] = ()
    """Parameters that a thicker wall makes larger: they vary between instances."""

    def __attrs_post_init__(self) -> None:
        fields = getattr(self.params, "_fields", None)
        if fields is None:
            raise TypeError(f"term {self.name!r}: params is {self.params!r}, which is no named tuple")
        strangers = {*self.positive, *self.stiffnesses} - set(fields)
        if strangers:
            raise TypeError(f"term {self.name!r}: {self.params.__name__} has no field {sorted(strangers)}")

    def importance(self, params: Any, at: WorkingPoint) -> float:
        """Return the greatest force (N) it would add on the way to this working point, by its own law.

        The way is as fast as the working point says and then stands there for what is left of its time.
        """
        if at.compression_m <= 0.0 or at.speed_m_s <= 0.0:
            return 0.0
        state, most, seconds = self.at_rest, 0.0, at.compression_m / at.speed_m_s
        for k in range(PIECES):
            d0, d1 = at.compression_m * k / PIECES, at.compression_m * (k + 1) / PIECES
            force, state = self.law(params, state, d0, d1, seconds / PIECES)
            most = max(most, abs(force))
        rest = at.seconds - seconds
        if rest > 0.0:
            force, state = self.law(params, state, at.compression_m, at.compression_m, rest)
            most = max(most, abs(force))
        return most
