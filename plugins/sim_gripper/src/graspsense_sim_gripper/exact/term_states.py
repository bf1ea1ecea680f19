"""Copying the states of the terms, which are named tuples, to and from the state vector.

Compiled code cannot loop over a tuple of different types. Each function here therefore handles the first term, and
calls the function for the remaining terms, which `term_state_functions` binds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from graspsense.plugin_api import bind
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.term import NO_STATE, TermState

MAX_NUMBERS: Final = 4
"""The largest number of fields of a state that is copied."""

TermsParams = Any
"""A tuple with the parameters of each term, which are `Switchable`."""
TermsStates = Any
"""A tuple with the state of each term."""
Vector = Any
"""The workspace of a tick: an array, or a list in the interpreter."""
TermStateFunctions = tuple[Callable[..., int], Callable[..., Any]]


def n_numbers(state: TermState) -> int:
    """Return how many places of the state vector a term's state takes: one for each field.

    It takes none if a field is not a float, or if there are more than MAX_NUMBERS.
    """
    return len(state) if all(isinstance(value, float) for value in state) and len(state) <= MAX_NUMBERS else 0


def term_state_functions(kinds: Sequence[str]) -> TermStateFunctions:
    """Return `pack` and `unpack` for an object with the lumped spring and damper and then terms of these kinds.

    `pack(terms, states, vector, at)` writes the states of the active terms to `vector` from index `at` on, and returns
    the index after them. `unpack(terms, states, vector, at)` returns the states with the values of active terms read
    from there, and the index after them. The state of an inactive term remains as it is.
    """
    pack, unpack = _pack_none, _unpack_none
    for state in reversed((NO_STATE, *(find_term(kind)[1].at_rest for kind in kinds))):
        n = n_numbers(state)
        pack = bind(_pack, pack_term=PACK[n], pack_others=pack)
        unpack = bind(_unpack, unpack_term=bind(UNPACK[n], make=type(state)), unpack_others=unpack)
    return pack, unpack


def _pack0(state: TermState, vector: Vector, at: int) -> int:
    return at


def _pack1(state: TermState, vector: Vector, at: int) -> int:
    vector[at] = state[0]
    return at + 1


def _pack2(state: TermState, vector: Vector, at: int) -> int:
    vector[at], vector[at + 1] = state[0], state[1]
    return at + 2


def _pack3(state: TermState, vector: Vector, at: int) -> int:
    vector[at], vector[at + 1], vector[at + 2] = state[0], state[1], state[2]
    return at + 3


def _pack4(state: TermState, vector: Vector, at: int) -> int:
    vector[at], vector[at + 1], vector[at + 2], vector[at + 3] = state[0], state[1], state[2], state[3]
    return at + 4


make: Any = tuple


def _unpack0(state: TermState, vector: Vector, at: int) -> tuple[TermState, int]:
    return state, at


def _unpack1(state: TermState, vector: Vector, at: int) -> tuple[TermState, int]:
    return make(vector[at]), at + 1


def _unpack2(state: TermState, vector: Vector, at: int) -> tuple[TermState, int]:
    return make(vector[at], vector[at + 1]), at + 2


def _unpack3(state: TermState, vector: Vector, at: int) -> tuple[TermState, int]:
    return make(vector[at], vector[at + 1], vector[at + 2]), at + 3


def _unpack4(state: TermState, vector: Vector, at: int) -> tuple[TermState, int]:
    return make(vector[at], vector[at + 1], vector[at + 2], vector[at + 3]), at + 4


PACK: Final = (_pack0, _pack1, _pack2, _pack3, _pack4)
UNPACK: Final = (_unpack0, _unpack1, _unpack2, _unpack3, _unpack4)
pack_term: Any = _pack0
unpack_term: Any = _unpack0


def _pack_none(terms: TermsParams, states: TermsStates, vector: Vector, at: int) -> int:
    return at


def _unpack_none(terms: TermsParams, states: TermsStates, vector: Vector, at: int) -> tuple[Any, int]:
    return (), at


pack_others: Any = _pack_none
unpack_others: Any = _unpack_none


def _pack(terms: TermsParams, states: TermsStates, vector: Vector, at: int) -> int:
    if terms[0].active == 1:
        at = pack_term(states[0], vector, at)
    return pack_others(terms[1:], states[1:], vector, at)  # type: ignore[no-any-return]


def _unpack(terms: TermsParams, states: TermsStates, vector: Vector, at: int) -> tuple[TermsStates, int]:
    state = states[0]
    if terms[0].active == 1:
        state, at = unpack_term(states[0], vector, at)
    others, at = unpack_others(terms[1:], states[1:], vector, at)
    return (state, *others), at
