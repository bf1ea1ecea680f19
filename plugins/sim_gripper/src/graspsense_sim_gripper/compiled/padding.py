"""What a grasp is compiled as: one composition for the whole catalogue, and of any other object what its model keeps.

Every composition takes seconds to compile. The terms of the catalogue's objects are few, so all of these objects are
compiled as one that has each of them once; a term that an object lacks is one that its model drops. Forces are summed
from the last term to the first, so that a term which adds nothing changes no bit: neither do those that are left out
of the composition of an object with terms of its own.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.dynamics.state import PlantState
from graspsense_sim_gripper.objects.library import catalogue
from graspsense_sim_gripper.sensing import PadCells
from graspsense_sim_gripper.setting import Setting, setting_of
from graspsense_sim_gripper.terms.registry import find_term, in_order
from graspsense_sim_gripper.terms.remainder import Kept


def _as_array(cells: PadCells) -> PadCells:
    return PadCells(np.array(cells.weights, float), np.array(cells.offset, float))


IDEAL: Final = _as_array(setting_of(SimConfig(sensor="ideal"), None, 0).sensor.left)
"""The cells of an ideal sensor, which nothing reads."""


class Filler(NamedTuple):
    """What stands in for a term that an object lacks: parameters nobody looks at, and its state at rest."""

    params: Kept
    state: Any


@cache
def common_kinds() -> tuple[str, ...]:
    """Return the terms of the catalogue's objects, each once, in the canonical order."""
    names = sorted({kind for spec in catalogue().values() for kind, _ in spec.terms})
    return tuple(names[i] for i in in_order(names))


def is_common(kinds: tuple[str, ...]) -> bool:
    """Return whether an object of these terms fits: none that the catalogue lacks, and none twice."""
    return len(set(kinds)) == len(kinds) and set(kinds) <= set(common_kinds())


NOTHING: Final = Filler(Kept(0, None), None)


class Layout(NamedTuple):
    """In which composition a grasp is compiled, and where its parts stand there, the remainder first."""

    kinds: tuple[str, ...]
    places: tuple[tuple[int, Filler], ...]
    """For each place which of the object's own it is (-1: none), and what fills it then."""
    own: tuple[tuple[int, Any], ...]
    """For each of the object's own its place (-1: none), and its state then."""


def layout_of(setting: Setting) -> Layout:
    """Return the composition in which this grasp is compiled."""
    if compiled_kinds(setting.kinds) is common_kinds():
        return _layout(setting.kinds, ())
    return _layout(setting.kinds, tuple([one.kept for one in setting.plant.thing.terms[1:]]))


@cache
def compiled_kinds(kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return the composition in which an object of these terms is compiled where its model keeps them all."""
    return common_kinds() if is_common(kinds) else kinds


@cache
def _layout(kinds: tuple[str, ...], kept: tuple[int, ...]) -> Layout:
    if kept:
        # Each kind once or more, those that its model keeps.
        there = [i for i, one in enumerate(kept) if one == 1]
        places = [(i + 1, NOTHING) for i in there]
        found = [(there.index(i) + 1 if i in there else -1, i) for i in range(len(kinds))]
        names = tuple(kinds[i] for i in there)
    else:
        names = common_kinds()
        places = [(kinds.index(k) + 1 if k in kinds else -1, _filler(k)) for k in names]
        found = [(names.index(kind) + 1, i) for i, kind in enumerate(kinds)]
    own = [(place, find_term(kinds[i])[1].at_rest) for place, i in found]
    return Layout(names, ((0, NOTHING), *places), ((0, None), *own))


def as_compiled(setting: Setting) -> Setting:
    """Return the same grasp as a compiled loop takes it: in that composition, the cells' figures as arrays."""
    # As tuples these would be handed over number by number, and looked up by a chain of comparisons.
    sensor = setting.sensor
    cells = (IDEAL, IDEAL) if sensor.ideal == 1 else (_as_array(sensor.left), _as_array(sensor.right))
    sensor = sensor._replace(left=cells[0], right=cells[1])
    kinds, plant, body = setting.kinds, setting.plant, setting.body
    layout = layout_of(setting)
    if kinds != layout.kinds:
        thing, places = plant.thing, layout.places
        own, state = thing.terms, body.contact.left.states
        terms = tuple([own[i] if i >= 0 else filler.params for i, filler in places])
        left = body.contact.left._replace(states=tuple([state[i] if i >= 0 else f.state for i, f in places]))
        right = left
        if body.contact.right is not body.contact.left:
            state = body.contact.right.states
            right = body.contact.right._replace(
                states=tuple([state[i] if i >= 0 else f.state for i, f in places])
            )
        kinds, plant = layout.kinds, plant._replace(thing=thing._replace(terms=terms))
        body = body._replace(contact=body.contact._replace(left=left, right=right))
    return Setting(
        kinds=kinds,
        terms=setting.terms,
        plant=plant,
        body=body,
        sensor=sensor,
        sensed=setting.sensed,
        dt_s=setting.dt_s,
        choice=setting.choice,
        drawn=setting.drawn,
    )


def as_own(body: PlantState, setting: Setting) -> PlantState:
    """Return the plant as it is at the end of a compiled grasp, with the object's own terms again."""
    layout = layout_of(setting)
    if layout.kinds == setting.kinds:
        return body
    own = layout.own
    left, right = (
        half._replace(states=tuple([half.states[i] if i >= 0 else rests for i, rests in own]))
        for half in (body.contact.left, body.contact.right)
    )
    return body._replace(contact=body.contact._replace(left=left, right=right))


@cache
def _filler(kind: str) -> Filler:
    _, term = find_term(kind)
    # Compiled code is of types: floats, as any parameters of it.
    return Filler(Kept(0, term.params(*(1.0 for _ in term.params._fields))), term.at_rest)
