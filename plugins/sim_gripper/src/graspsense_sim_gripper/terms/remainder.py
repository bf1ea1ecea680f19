"""What the limits of a scene's terms come to together: one spring and one damper. And a term that may be left out."""

from __future__ import annotations

from typing import Any, NamedTuple

from graspsense_sim_gripper.terms.term import Law, LinearForm, NoState


class Remainder(NamedTuple):
    """A spring and a damper on the compression."""

    spring_n_m: float
    damper_n_s_m: float


def remainder(
    params: Remainder, state: NoState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, NoState]:
    """Return the force of both."""
    return params.spring_n_m * d1 + params.damper_n_s_m * v1, state


def linear(params: Remainder) -> LinearForm:
    """Return both."""
    return LinearForm(params.spring_n_m, params.damper_n_s_m)


class Kept(NamedTuple):
    """A term's parameters, and whether it is kept (1) or left out (0).

    So the models of different accuracy of one scene are one composition, compiled once.
    """

    kept: int
    params: Any


law: Law = remainder


def where_kept(term: Kept, state: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    """Return what `law` does where the term is kept, and nothing where it is not."""
    if term.kept == 0:
        return 0.0, state
    return law(term.params, state, d0, d1, h, v1)
