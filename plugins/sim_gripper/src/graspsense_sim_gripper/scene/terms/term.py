"""The declaration of a term: a part of the force of an object, with all that the simulator needs to know about it.

A term can be switched off by a parameter. All objects of the catalogue are therefore one composition, which is compiled
once.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, Final, NamedTuple

from attrs import frozen

TermParams = Any
"""The parameters of a term: a named tuple of its own type."""
TermState = Any
"""The state of a term: a named tuple of its own type."""
Phase = Callable[[TermState], int]
"""`phase(state)`: which part of the law the state is in."""
Moves = Callable[[TermState], bool]
"""`moves(state)`: whether the state still changes in a free object that has its shape."""
Law = Callable[[TermParams, TermState, float, float, float, float], tuple[float, TermState]]
"""`law(params, state, d0, d1, h, v1) -> (force, state)`: from d0 to d1 (m) in h (s), then at v1 (m/s)."""

SumLaw = Callable[[TermParams, TermState, float, float], tuple[float, TermState]]
"""`on_sum(params, state, force_n, d1) -> (force, state)`: the force of the object from the sum of its other terms."""

LAW_ERRORS: Final = (ArithmeticError, ValueError)
"""What a law may raise where it has no value, such as a division by zero or the root of a negative number."""


class OnSum(NamedTuple):
    """The law of a term that acts on the sum of the other terms' forces, in a list of laws: the last of them."""

    law: SumLaw


class NoState(NamedTuple):
    """The state of a term without a memory."""


class WorkingPoint(NamedTuple):
    """The operating range of a grasp: the compression of the object, its rate, its duration and the force."""

    compression_m: float
    speed_m_s: float
    seconds: float
    force_n: float = 1.0


class Rate(NamedTuple):
    """The rate of a state of a term: it `relaxes` (1/s) or `swings` (an angular frequency, rad/s)."""

    what: str
    per_s: float


def no_rates(params: TermParams, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return the rates of a state that changes at events only, or follows from the compression: none."""
    return ()


def no_force(
    params: TermParams, state: TermState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, TermState]:
    """Return no force: the law of a term that acts on the sum of the others."""
    return 0.0, state


NO_STATE: Final = NoState()


@frozen(kw_only=True)
class Term:
    """A kind of term: its name in a scene, parameters, law, and state at rest.

    `params` is a named tuple of floats; a scene may omit a field that has a default. The law is a pure function that
    runs both in the interpreter and compiled: floats and named tuples, no closure, no `x**2`. It integrates its own
    state, and is stable however fast that is. `positive` names the parameters that must not be zero; only those that
    `signed` names may be negative.
    """

    name: str
    summary: str
    params: type[Any]
    law: Law
    at_rest: TermState = NO_STATE
    rates: Callable[[TermParams, WorkingPoint], tuple[Rate, ...]] | None = None
    """Returns the rates of its states at a working point; None: those of a term with a state are unknown."""
    divides_steps: bool = False
    """Whether the law divides a step by itself to resolve the oscillation that its rates give, as a contact inside of
    the term needs it. For any other term the simulator takes steps that are short enough."""
    positive: tuple[str, ...] = ()
    signed: tuple[str, ...] = ()
    refusal: Callable[[TermParams], str] | None = None
    """Returns why there is no law with these parameters and what is allowed, "" if there is one; None: there is one for
    all parameters."""
    on_sum: SumLaw | None = None
    """The law of a term that acts on the sum of the other terms' forces, as a fracture does; its `law` is `no_force`.

    An object has at most one such term. It runs compiled, like a law.
    """
    stiffnesses: tuple[str, ...] = ()
    """Parameters that grow with the thickness of the wall; they vary between instances."""
    beyond: Callable[[TermState], str] | None = None
    """Returns why a state is outside of the range of the law, "" if it is not; None: the law always holds."""
    phase: Phase | None = None
    """Returns which part of the law (0 to 7) the state is in, such as 1 for broken; None: there is one part. Runs
    compiled, like the law.

    Where it changes, law or slope of the force change at once: an event, which the simulator locates within the tick.
    """
    moves: Moves | None = None
    """Returns whether the state still changes in a free object that has its shape, as a mass does that swings behind a
    separated contact; None: it never does. Until it is still, the object counts as touched. Runs compiled, like the
    law."""
    dent: Callable[[TermParams], float] | None = None
    """Returns by how much (m) earlier use has made the object thinner; None: it has not. Compression is counted from
    the dented surface on."""

    def __attrs_post_init__(self) -> None:
        fields = getattr(self.params, "_fields", None)
        if fields is None:
            raise TypeError(f"term {self.name!r}: params is {self.params!r}, which is not a named tuple")
        if reserved := {"type", "spread"} & set(fields):
            raise TypeError(
                f"term {self.name!r}: no parameter may be called {sorted(reserved)}: scenes use that key"
            )
        strangers = {*self.positive, *self.signed, *self.stiffnesses} - set(fields)
        if strangers:
            raise TypeError(f"term {self.name!r}: {self.params.__name__} has no field {sorted(strangers)}")


class Switchable(NamedTuple):
    """The parameters of a term, and whether it is active (1) or switched off (0)."""

    active: int
    params: TermParams


def switched_off(terms: Sequence[Switchable], which: Collection[int]) -> tuple[Switchable, ...]:
    """Return these terms, with those at the places `which` switched off."""
    return tuple([Switchable(0, term.params) if i in which else term for i, term in enumerate(terms)])


def _unchanged(params: TermParams, state: TermState, force_n: float, d1: float) -> tuple[float, TermState]:
    return force_n, state


law: Law = no_force
on_sum: SumLaw = _unchanged


def switched(
    term: Switchable, state: TermState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, TermState]:
    """Return the force and the new state of `law` if the term is active, otherwise no force and the old state."""
    if term.active == 0:
        return 0.0, state
    return law(term.params, state, d0, d1, h, v1)


def switched_on_sum(term: Switchable, state: TermState, force_n: float, d1: float) -> tuple[float, TermState]:
    """Return what `on_sum` makes of the force if the term is active, otherwise that force and the old state."""
    if term.active == 0:
        return force_n, state
    return on_sum(term.params, state, force_n, d1)
