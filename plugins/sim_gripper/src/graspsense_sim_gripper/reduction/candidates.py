"""The simplifications of a term and of the pads, and the reduced model of an instance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from attrs import evolve

from graspsense_sim_gripper.dynamics.contact import ObjectModel
from graspsense_sim_gripper.problem import GraspSetup
from graspsense_sim_gripper.reduction.levels import balance_rtol
from graspsense_sim_gripper.reduction.model import DROPPED, KEPT, Reduction
from graspsense_sim_gripper.stepping.scheme import PlantParams
from graspsense_sim_gripper.terms.lumped import LumpedSpringDamper
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.switchable import Switchable
from graspsense_sim_gripper.terms.term import WorkingPoint

Candidate = tuple[str, ObjectModel]
"""The name of a simplification, and the model that it gives."""
RIGID_PADS: Final = "rigid"
ELASTIC_PADS: Final = "springs"
UNRELAXED_PADS: Final = "springs that do not creep"
"""Springs with the stiffness before creep, to which the Maxwell branch still contributes."""


def without_term(
    model: ObjectModel, kinds: Sequence[str], i: int, point: WorkingPoint
) -> Iterator[Candidate]:
    """Yield the model with term `i` dropped, then with each of the term's limits at the working point.

    `i` counts the terms in `kinds`, without the lumped spring and damper. A limit that is the term itself is skipped.
    """
    params = model.terms[i + 1].params
    yield DROPPED, _dropped(model, i)
    for limit in find_term(kinds[i])[1].limits(params, point):
        if limit.params == params and limit.spring_n_m == 0.0 and limit.damper_n_s_m == 0.0:
            continue
        term = Switchable(0, params)
        if limit.params is not None:
            term = Switchable(1, params._make(float(value) for value in limit.params))
        yield limit.name, _with(model, i, term, limit.spring_n_m, limit.damper_n_s_m)


def simpler_pads(model: ObjectModel) -> Iterator[Candidate]:
    """Yield the model with rigid pads, then with pads that are springs without a damper or creep.

    A simplification that the pads already have is left out.
    """
    pads = model.pads
    if pads.stiffness_n_m < math.inf:
        yield RIGID_PADS, model._replace(pads=pads._replace(stiffness_n_m=math.inf))
    if pads.damping_n_s_m > 0.0 or pads.branch_n_m > 0.0:
        elastic = pads._replace(damping_n_s_m=0.0, branch_n_m=0.0)
        yield ELASTIC_PADS, model._replace(pads=elastic)
        unrelaxed = elastic._replace(stiffness_n_m=pads.stiffness_n_m + pads.branch_n_m)
        yield UNRELAXED_PADS, model._replace(pads=unrelaxed)


def named(name: str, candidates: Iterator[Candidate]) -> ObjectModel:
    """Return the model of the candidate with this name. Raises StopIteration if there is none."""
    return next(model for candidate, model in candidates if candidate == name)


def reduced(setup: GraspSetup, reduction: Reduction) -> GraspSetup:
    """Return the grasp of an instance with the reduced model and its steps; `setup` has all terms."""
    return evolve(setup, plant=reduce_plant(setup.plant, setup.kinds, reduction))


def reduce_plant(plant: PlantParams, kinds: Sequence[str], reduction: Reduction) -> PlantParams:
    """Return the plant of an instance with the reduced model and its steps; `plant` has all terms."""
    steps, model = reduction.steps, reduce_model(plant.object, kinds, reduction)
    if steps.settle == 0.0:
        model = model._replace(balance_rtol=balance_rtol(reduction.level.step_tol))
    return PlantParams(plant.drive, model, steps)


def reduce_model(model: ObjectModel, kinds: Sequence[str], reduction: Reduction) -> ObjectModel:
    """Return the reduced model of an instance; `model` has all its terms."""
    for i, treatment in enumerate(reduction.treatment[:-1]):
        if treatment == DROPPED:
            model = _dropped(model, i)
        elif treatment != KEPT:
            model = named(treatment, without_term(model, kinds, i, reduction.point))
    if reduction.treatment[-1] != KEPT:
        model = named(reduction.treatment[-1], simpler_pads(model))
    return model._replace(overshoots=1 if reduction.oscillates else 0)


def _dropped(model: ObjectModel, i: int) -> ObjectModel:
    """Return the model without term `i`."""
    return _with(model, i, Switchable(0, model.terms[i + 1].params), 0.0, 0.0)


def _with(
    model: ObjectModel, i: int, term: Switchable, spring_n_m: float, damper_n_s_m: float
) -> ObjectModel:
    """Return the model with `term` in place of term `i`, and with this much added to the lumped spring and damper."""
    before = model.terms[0].params
    spring, damper = before.spring_n_m + spring_n_m, before.damper_n_s_m + damper_n_s_m
    lumped = Switchable(1 if spring > 0.0 or damper > 0.0 else 0, LumpedSpringDamper(spring, damper))
    terms = (lumped, *model.terms[1 : i + 1], term, *model.terms[i + 2 :])
    return model._replace(terms=terms)
