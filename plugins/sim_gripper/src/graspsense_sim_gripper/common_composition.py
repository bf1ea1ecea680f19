"""One composition for the whole catalogue: what an object has no use for stands in it, left out.

Every composition takes seconds to compile. The terms of the catalogue's objects are few, so all of these objects are
compiled as one that has each of them once; a term that an object lacks is one that its model drops. Forces are summed
from the last term to the first, so that a term which adds nothing changes no bit.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from attrs import evolve

from graspsense_sim_gripper.plant import PlantState, Squeezed
from graspsense_sim_gripper.scene import catalogue
from graspsense_sim_gripper.setting import Setting
from graspsense_sim_gripper.terms.registry import find_term, in_order
from graspsense_sim_gripper.terms.remainder import Kept


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


def compiled_kinds(kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return the composition in which an object of these terms is compiled."""
    return common_kinds() if is_common(kinds) else kinds


def filled(setting: Setting) -> Setting:
    """Return the same grasp in that composition."""
    if setting.kinds == compiled_kinds(setting.kinds):
        return setting
    thing, body = setting.plant.thing, setting.body
    own = dict(zip(setting.kinds, thing.terms[1:], strict=True))
    terms = (thing.terms[0], *[own.get(kind) or _filler(kind).params for kind in common_kinds()])
    left = _more(body.squeezed, setting.kinds)
    return evolve(
        setting,
        kinds=common_kinds(),
        plant=setting.plant._replace(thing=thing._replace(terms=terms)),
        body=body._replace(
            squeezed=left, right=left if body.right is body.squeezed else _more(body.right, setting.kinds)
        ),
    )


def as_compiled(setting: Setting) -> Setting:
    """Return the same grasp as a compiled loop takes it: in that composition, the cells' figures as arrays."""
    # As tuples these would be handed over number by number, and looked up by a chain of comparisons.
    sensor = setting.sensor
    sensor = sensor._replace(
        left_weights=np.array(sensor.left_weights),
        right_weights=np.array(sensor.right_weights),
        left_offset=np.array(sensor.left_offset),
        right_offset=np.array(sensor.right_offset),
    )
    return evolve(filled(setting), sensor=sensor)


def emptied(body: PlantState, kinds: tuple[str, ...]) -> PlantState:
    """Return the plant of an object of these terms as it would be without what was filled in."""
    if kinds == compiled_kinds(kinds):
        return body
    places = [0, *(1 + common_kinds().index(kind) for kind in kinds)]
    squeezed, right = (
        half._replace(states=tuple(half.states[i] for i in places)) for half in (body.squeezed, body.right)
    )
    return body._replace(squeezed=squeezed, right=right)


def _more(half: Squeezed, kinds: tuple[str, ...]) -> Squeezed:
    own = dict(zip(kinds, half.states[1:], strict=True))
    return half._replace(
        states=(half.states[0], *(own.get(kind, _filler(kind).state) for kind in common_kinds()))
    )


@cache
def _filler(kind: str) -> Filler:
    _, term = find_term(kind)
    # Compiled code is of types: floats, as any parameters of it.
    return Filler(Kept(0, term.params(*(1.0 for _ in term.params._fields))), term.at_rest)
