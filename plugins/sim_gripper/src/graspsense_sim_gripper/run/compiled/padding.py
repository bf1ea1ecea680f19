"""Padding a grasp with unused terms, so that few compositions have to be compiled.

Compiling takes seconds per composition. The objects of the catalogue have few kinds of terms among them. All of them
therefore share one composition that contains each kind once; the terms that an object does not have are switched off.
Any other object is compiled with its own terms. Forces are added from the last term to the
first, so that a term that is switched off changes no bit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, lru_cache
from typing import Final, NamedTuple

from attrs import frozen

from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.state import Contact, ContactState
from graspsense_sim_gripper.run.compiled.compose import Composition, composition
from graspsense_sim_gripper.run.problem import GraspSetup
from graspsense_sim_gripper.scene.library import catalogue
from graspsense_sim_gripper.scene.terms.registry import find_term, in_order
from graspsense_sim_gripper.scene.terms.switchable import Switchable
from graspsense_sim_gripper.scene.terms.term import TermState
from graspsense_sim_gripper.solve.scheme import PlantParams
from graspsense_sim_gripper.solve.state import PlantState


class Filler(NamedTuple):
    """The placeholder of a term that an object does not have: unused parameters, and the state at rest."""

    params: Switchable
    state: TermState


TermStates = tuple[TermState, ...]
"""The states of the terms of an object, or of one half of it."""
NOTHING: Final = Filler(Switchable(0, None), None)


@frozen(eq=False)
class PaddedLayout:
    """The terms of a composition, and the positions of an object's own terms in it."""

    kinds: tuple[str, ...]
    sources: tuple[tuple[int, Filler], ...]
    """For each position the index of the object's own term, or -1 and the placeholder in its stead."""
    places: tuple[int, ...]
    """For each of the object's own terms its position."""


def layout_of(setup: GraspSetup, kinds: tuple[str, ...] | None = None) -> PaddedLayout:
    """Return the layout in which a grasp is compiled: with these kinds; None: as in a batch."""
    if kinds is not None:
        return _with_kinds(setup.kinds, kinds)
    if is_common(setup.kinds):
        return _with_kinds(setup.kinds, common_kinds())
    return _own_kinds(setup.kinds)


@cache
def common_kinds() -> tuple[str, ...]:
    """Return the kinds of all terms in the catalogue, each once, in the canonical order."""
    names = sorted({kind for spec in catalogue().values() for kind, _ in spec.terms})
    return tuple(names[i] for i in in_order(names))


@lru_cache(maxsize=1024)
def is_common(kinds: tuple[str, ...]) -> bool:
    """Return whether these terms fit into the composition of the catalogue: each is of its kinds, and none is twice."""
    return len(set(kinds)) == len(kinds) and set(kinds) <= set(common_kinds())


def compiled_kinds(kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return the kinds in the composition of an object with these terms."""
    return common_kinds() if is_common(kinds) else kinds


def composition_of(setup: GraspSetup, *, pad: bool = True) -> Composition:
    """Return the composition in which a grasp is compiled; not `pad`: with the object's own terms."""
    kinds = layout_of(setup).kinds if pad else setup.kinds
    return composition(kinds, setup.plant)


def padded(setup: GraspSetup, kinds: tuple[str, ...] | None = None) -> GraspSetup:
    """Return the same grasp for a compiled loop, in the layout of `layout_of`."""
    layout = layout_of(setup, kinds)
    if setup.kinds == layout.kinds:
        return setup
    drive, (width_m, table_n, pads, own, held, overshoots, rtol), steps = setup.plant
    terms = tuple([own[i] if i >= 0 else filler.params for i, filler in layout.sources])
    # Here and below, `evolve` and `_replace` would take several times as long.
    model = ObjectModel(
        width_m=width_m,
        table_friction_n=table_n,
        pads=pads,
        terms=terms,
        held=held,
        overshoots=overshoots,
        balance_rtol=rtol,
    )
    return GraspSetup(
        kinds=layout.kinds,
        terms=setup.terms,
        plant=PlantParams(drive, model, steps),
        state=_with_term_states(
            setup.state,
            lambda states: tuple([states[i] if i >= 0 else f.state for i, f in layout.sources]),
        ),
        sensor=setup.sensor,
        sensor_state=setup.sensor_state,
        dt_s=setup.dt_s,
        seed=setup.seed,
    )


def unpadded(state: PlantState, layout: PaddedLayout) -> PlantState:
    """Return the state of the plant after a grasp in this layout, with the states of the object's own terms only."""
    return _with_term_states(state, lambda states: tuple([states[i] for i in layout.places]))


def _with_term_states(state: PlantState, change: Callable[[TermStates], TermStates]) -> PlantState:
    """Return the state of the plant with `of(states)` in place of the states of the terms, in each half."""
    motion, contact, step, effort_n, peak_n = state
    left_n, right_n, offset_m, touched, left, right, pending_s, unbalanced = contact
    halves = []
    for half in (left, *right):
        compression_m, force_n, slope_n_m, states, pad_m, branch_n, past = half
        halves.append(
            ContactState(
                compression_m=compression_m,
                force_n=force_n,
                slope_n_m=slope_n_m,
                states=change(states),
                pad_m=pad_m,
                branch_n=branch_n,
                past=past,
            )
        )
    contact = Contact(
        left_n=left_n,
        right_n=right_n,
        offset_m=offset_m,
        touched=touched,
        left=halves[0],
        right=tuple(halves[1:]),
        pending_s=pending_s,
        unbalanced=unbalanced,
    )
    return PlantState(motion=motion, contact=contact, step=step, effort_n=effort_n, peak_n=peak_n)


@lru_cache(maxsize=256)
def _with_kinds(own: tuple[str, ...], kinds: tuple[str, ...]) -> PaddedLayout:
    sources = tuple((own.index(kind) if kind in own else -1, _filler(kind)) for kind in kinds)
    return PaddedLayout(kinds, sources, tuple(kinds.index(kind) for kind in own))


@lru_cache(maxsize=256)
def _own_kinds(own: tuple[str, ...]) -> PaddedLayout:
    """Return the layout of an object with its own terms only. A kind may occur more than once."""
    places = range(len(own))
    return PaddedLayout(own, tuple((i, NOTHING) for i in places), tuple(places))


@lru_cache(maxsize=256)
def _filler(kind: str) -> Filler:
    _, term = find_term(kind)
    # Compiled code distinguishes types: the parameters must be floats, whatever their value.
    return Filler(Switchable(0, term.params(*(1.0 for _ in term.params._fields))), term.at_rest)
