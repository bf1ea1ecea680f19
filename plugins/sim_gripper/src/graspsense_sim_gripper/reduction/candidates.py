"""What may stand for a term or for the pads in a reduced model, and the reduced model of an instance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from attrs import evolve

from graspsense_sim_gripper.dynamics.contact import ObjectModel
from graspsense_sim_gripper.problem import GraspSetup
from graspsense_sim_gripper.reduction.model import DROPPED, KEPT, Reduction
from graspsense_sim_gripper.stepping.scheme import PlantParams
from graspsense_sim_gripper.terms.lumped import LumpedSpringDamper
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.switchable import Switchable
from graspsense_sim_gripper.terms.term import WorkingPoint

Candidate = tuple[str, ObjectModel]
"""The name of a simplification, and the model with it."""
RIGID_PADS: Final = "rigid"
ELASTIC_PADS: Final = "springs"
RELAXED_PADS: Final = "springs that do not creep"


def without_term(
    model: ObjectModel, kinds: Sequence[str], i: int, point: WorkingPoint
) -> Iterator[Candidate]:
    """Yield the model with term `i` dropped, then with each of the term's limits."""
    params = model.terms[i + 1].params
    yield DROPPED, _with(model, i, Switchable(0, params), 0.0, 0.0)
    for limit in find_term(kinds[i])[1].limits(params, point):
        if limit.params == params and limit.spring_n_m == 0.0 and limit.damper_n_s_m == 0.0:
            continue
        term = Switchable(0, params)
        if limit.params is not None:
            term = Switchable(1, params._make(float(value) for value in limit.params))
        yield limit.name, _with(model, i, term, limit.spring_n_m, limit.damper_n_s_m)


def simpler_pads(model: ObjectModel) -> Iterator[Candidate]:
    """Yield the model with simpler pads, the simplest first."""
    pads = model.pads
    if pads.stiffness_n_m < math.inf:
        yield RIGID_PADS, model._replace(pads=pads._replace(stiffness_n_m=math.inf))
    if pads.damping_n_s_m > 0.0 or pads.branch_n_m > 0.0:
        elastic = pads._replace(damping_n_s_m=0.0, branch_n_m=0.0)
        yield ELASTIC_PADS, model._replace(pads=elastic)
        relaxed = elastic._replace(stiffness_n_m=pads.stiffness_n_m + pads.branch_n_m)
        yield RELAXED_PADS, model._replace(pads=relaxed)


def named(name: str, candidates: Iterator[Candidate]) -> ObjectModel:
    """Return the model of the candidate with this name."""
    return next(model for candidate, model in candidates if candidate == name)


def reduced(setup: GraspSetup, reduction: Reduction) -> GraspSetup:
    """Return the grasp of an instance with all its terms as the reduction simulates it, with its steps."""
    return evolve(setup, plant=reduce_plant(setup.plant, setup.kinds, reduction))


def reduce_plant(plant: PlantParams, kinds: Sequence[str], reduction: Reduction) -> PlantParams:
    """Return the plant of an instance as the reduction simulates it, with its steps."""
    return PlantParams(plant.drive, reduce_model(plant.object, kinds, reduction), reduction.steps)


def reduce_model(model: ObjectModel, kinds: Sequence[str], reduction: Reduction) -> ObjectModel:
    """Return the full model of an instance as the reduction simulates it."""
    for i, treatment in enumerate(reduction.treatment[:-1]):
        if treatment != KEPT:
            model = named(treatment, without_term(model, kinds, i, reduction.point))
    if reduction.treatment[-1] != KEPT:
        model = named(reduction.treatment[-1], simpler_pads(model))
    return model._replace(overshoots=1 if reduction.oscillates else 0)


def _with(
    model: ObjectModel, i: int, term: Switchable, spring_n_m: float, damper_n_s_m: float
) -> ObjectModel:
    """Return the model with another term `i`, and with more of the spring and damper that limits leave."""
    before = model.terms[0].params
    spring, damper = before.spring_n_m + spring_n_m, before.damper_n_s_m + damper_n_s_m
    lumped = Switchable(1 if spring > 0.0 or damper > 0.0 else 0, LumpedSpringDamper(spring, damper))
    terms = (lumped, *model.terms[1 : i + 1], term, *model.terms[i + 2 :])
    return model._replace(terms=terms)
