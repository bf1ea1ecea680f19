"""One composition for the whole catalogue: what an object has no use for stands in it, left out.

Every composition takes seconds to compile. The terms of the catalogue's objects are few, so all of these objects are
compiled as one that has each of them once; a term that an object lacks is one that its model drops. Forces are summed
from the last term to the first, so that a term which adds nothing changes no bit.
"""

from __future__ import annotations

from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant import PlantState
from graspsense_sim_gripper.scene import catalogue
from graspsense_sim_gripper.setting import Setting, setting_of
from graspsense_sim_gripper.terms.registry import find_term, in_order
from graspsense_sim_gripper.terms.remainder import Kept


def _arrays(figures: Any) -> dict[str, Any]:
    """Return the figures of a sensor's cells as arrays."""
    names = "left_weights", "right_weights", "left_offset", "right_offset"
    return {name: np.array(getattr(figures, name), float) for name in names}


IDEAL: Final = _arrays(setting_of(SimConfig(sensor="ideal"), None, 0).sensor)
"""Those of an ideal sensor, which nobody looks at."""


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


@cache
def compiled_kinds(kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return the composition in which an object of these terms is compiled."""
    return common_kinds() if is_common(kinds) else kinds


def as_compiled(setting: Setting) -> Setting:
    """Return the same grasp as a compiled loop takes it: in that composition, the cells' figures as arrays."""
    # As tuples these would be handed over number by number, and looked up by a chain of comparisons.
    sensor = setting.sensor
    sensor = sensor._replace(**(IDEAL if sensor.ideal == 1 else _arrays(sensor)))
    kinds, plant, body = setting.kinds, setting.plant, setting.body
    if kinds != compiled_kinds(kinds):
        thing = plant.thing
        places = _places(kinds)
        own, state = thing.terms, body.squeezed.states
        terms = tuple([own[i] if i >= 0 else filler.params for i, filler in places])
        left = body.squeezed._replace(states=tuple([state[i] if i >= 0 else f.state for i, f in places]))
        right = left
        if body.right is not body.squeezed:
            state = body.right.states
            right = body.right._replace(states=tuple([state[i] if i >= 0 else f.state for i, f in places]))
        kinds, plant = common_kinds(), plant._replace(thing=thing._replace(terms=terms))
        body = body._replace(squeezed=left, right=right)
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


def emptied(body: PlantState, kinds: tuple[str, ...]) -> PlantState:
    """Return the plant of an object of these terms as it would be without what was filled in."""
    if kinds == compiled_kinds(kinds):
        return body
    own = _own_places(kinds)
    left, right = (
        half._replace(states=tuple([half.states[i] for i in own])) for half in (body.squeezed, body.right)
    )
    return body._replace(squeezed=left, right=right)


@cache
def _places(kinds: tuple[str, ...]) -> tuple[tuple[int, Filler], ...]:
    """Return for each place of the common composition which of an object's own it is (-1: none), and what fills it."""
    first = Filler(Kept(0, None), None)
    return (0, first), *((kinds.index(k) + 1 if k in kinds else -1, _filler(k)) for k in common_kinds())


@cache
def _own_places(kinds: tuple[str, ...]) -> tuple[int, ...]:
    return 0, *(1 + common_kinds().index(kind) for kind in kinds)


@cache
def _filler(kind: str) -> Filler:
    _, term = find_term(kind)
    # Compiled code is of types: floats, as any parameters of it.
    return Filler(Kept(0, term.params(*(1.0 for _ in term.params._fields))), term.at_rest)
