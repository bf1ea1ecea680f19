"""Padding a grasp with unused terms, so that few compositions have to be compiled.

Compiling takes seconds per composition. The objects of the catalogue have few kinds of terms among them. All of them
therefore share one composition that contains each kind once; the terms that an object does not have are switched off.
Any other object is compiled with its own terms. Forces are added from the last term to the
first, so that a term that is switched off changes no bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, lru_cache
from typing import Any

from attrs import evolve

from graspsense_sim_gripper.plant.state import ContactState
from graspsense_sim_gripper.run.compiled.compose import Composition, composition, uncompressed
from graspsense_sim_gripper.run.problem import GraspSetup
from graspsense_sim_gripper.scene.library import catalogue
from graspsense_sim_gripper.scene.terms.registry import find_term, in_order
from graspsense_sim_gripper.scene.terms.term import Switchable, TermState
from graspsense_sim_gripper.solve.scheme import PlantState

TermStates = tuple[TermState, ...]
"""The states of the terms of an object, or of one half of it."""


@cache
def common_kinds() -> tuple[str, ...]:
    """Return the kinds of all terms in the catalogue, each once, in the canonical order."""
    names = sorted({kind for spec in catalogue().values() for kind, _ in spec.terms})
    return tuple(names[i] for i in in_order(names))


def compiled_kinds(kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return the kinds in the composition of an object with these terms.

    They are those of the catalogue if each of its terms is of these, and none is twice; else its own.
    """
    fits = len(set(kinds)) == len(kinds) and set(kinds) <= set(common_kinds())
    return common_kinds() if fits else kinds


@lru_cache(maxsize=1024)
def places_of(own: tuple[str, ...], kinds: tuple[str, ...] | None = None) -> tuple[int, ...]:
    """Return the place of each of an object's own terms among those of its composition; `kinds`: as for `padded`."""
    kinds = kinds or compiled_kinds(own)
    # In a composition of its own, a kind may occur more than once.
    return tuple(range(len(own))) if kinds == own else tuple(map(kinds.index, own))


def composition_of(setup: GraspSetup) -> Composition:
    """Return the composition in which a grasp is compiled."""
    return composition(compiled_kinds(setup.kinds), setup.plant)


def padded(setup: GraspSetup, kinds: tuple[str, ...] | None = None) -> GraspSetup:
    """Return the same grasp with terms of these kinds, as many of which are its own; None: those of its composition."""
    kinds = kinds or compiled_kinds(setup.kinds)
    if setup.kinds == kinds:
        return setup
    places = places_of(setup.kinds, kinds)
    # Compiled code distinguishes types: the parameters must be floats, whatever their value.
    params = [find_term(kind)[1].params for kind in kinds]
    unused = [Switchable(0, kind(*(1.0 for _ in kind._fields))) for kind in params]
    model = setup.plant.object._replace(terms=_with(unused, places, setup.plant.object.terms))
    at_rest = uncompressed(kinds).states
    return evolve(
        setup,
        kinds=kinds,
        plant=setup.plant._replace(object=model),
        state=_with_term_states(setup.state, lambda states: _with(at_rest, places, states)),
    )


def unpadded(state: PlantState, places: Sequence[int]) -> PlantState:
    """Return the state of the plant after a padded grasp, with the states of the object's own terms only."""
    return _with_term_states(state, lambda states: tuple([states[place] for place in places]))


def _with(values: Sequence[Any], places: Sequence[int], own: Sequence[Any]) -> tuple[Any, ...]:
    """Return these values, with others at these places."""
    by_place = dict(zip(places, own, strict=True))
    return tuple([by_place.get(i, value) for i, value in enumerate(values)])


def _with_term_states(state: PlantState, change: Callable[[TermStates], TermStates]) -> PlantState:
    """Return the state of the plant with `change(states)` in place of the states of the terms, in each half."""

    def changed(half: ContactState) -> ContactState:
        return half._replace(states=change(half.states))

    contact = state.contact
    halves = changed(contact.left), tuple(map(changed, contact.right))
    return state._replace(contact=contact._replace(left=halves[0], right=halves[1]))
