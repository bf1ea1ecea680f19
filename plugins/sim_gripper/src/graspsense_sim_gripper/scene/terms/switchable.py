"""A term that can be switched off by a parameter.

All objects of the catalogue are therefore one composition, which is compiled once.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.term import Law, SumLaw, TermParams, TermState, no_force


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
