"""What a term is: a part of an object's force with everything the simulator has to know of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from attrs import frozen

Law = Callable[[Any, Any, float, float, float, float], tuple[float, Any]]
"""`law(params, state, d0, d1, h, v1) -> (force, state)`: from d0 to d1 (m) in h (s), then at v1 (m/s)."""

PIECES: Final = 256


class NoState(NamedTuple):
    """The state of a term that remembers nothing."""


class WorkingPoint(NamedTuple):
    """What a grasp does with an object: how far it compresses it, how fast, for how long, and up to what force."""

    compression_m: float
    speed_m_s: float
    seconds: float
    force_n: float = 1.0


class Rate(NamedTuple):
    """How fast a state of a term goes its own way: `relaxes` (1/s) or `swings` (rad/s)."""

    what: str
    per_s: float


class Limit(NamedTuple):
    """What a term comes to where its states are fast or slow: a spring and a damper, or itself with other numbers."""

    name: str
    params: Any = None
    """The term's own parameters there; None: it is the spring and the damper alone."""
    spring_n_m: float = 0.0
    damper_n_s_m: float = 0.0


class LinearForm(NamedTuple):
    """A term that is linear: s' = A s + b d + c d' of its states s, force k d + g d' + f s.

    d is the compression (m); the states are the fields of the term's state, in their order, all floats. A form
    without `rates` leaves the state as it is.
    """

    spring_n_m: float = 0.0
    """k"""
    damper_n_s_m: float = 0.0
    """g, not negative"""
    rates: tuple[tuple[float, ...], ...] = ()
    """A, a row a state"""
    by_compression: tuple[float, ...] = ()
    """b"""
    by_speed: tuple[float, ...] = ()
    """c"""
    force: tuple[float, ...] = ()
    """f"""


class OwnContact(NamedTuple):
    """A term with a contact of its own: linear while it touches and while it is parted, its force the same between.

    It touches where d + reach s (m) is greater than 0.
    """

    touching: LinearForm
    parted: LinearForm
    reach: tuple[float, ...]


def not_linear(params: Any) -> LinearForm | OwnContact | None:
    """Return the linear form of a term that has none."""
    del params
    return None


def no_limits(params: Any, at: WorkingPoint) -> tuple[Limit, ...]:
    """Return the limits of a term that has none: it is kept or dropped."""
    del params, at
    return ()


def no_rates(params: Any, at: WorkingPoint) -> tuple[Rate, ...]:
    """Return the rates of a term that does not give any: of one with a state nobody knows then how it moves."""
    del params, at
    return ()


def never_beyond(state: Any) -> str:
    """Return why the law of a term does not hold, of one that always does: nothing."""
    del state
    return ""


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
    limits: Callable[[Any, WorkingPoint], tuple[Limit, ...]] = no_limits
    """What may stand for it, cheapest first; whether it may is found by the force it then gives."""
    linear: Callable[[Any], LinearForm | OwnContact | None] = not_linear
    """Its linear form with these parameters, or None. The scene can be discretised exactly where every term has one."""
    positive: tuple[str, ...] = ()
    stiffnesses: tuple[str, ...] = ()
    """Parameters that a thicker wall makes larger: they vary between instances."""
    beyond: Callable[[Any], str] = never_beyond
    """Told a state, why its law was pressed beyond what it describes; empty where it was not."""

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
            force, state = self.law(params, state, d0, d1, seconds / PIECES, at.speed_m_s)
            most = max(most, abs(force))
        rest = at.seconds - seconds
        if rest > 0.0:
            force, state = self.law(params, state, at.compression_m, at.compression_m, rest, 0.0)
            most = max(most, abs(force))
        return most
