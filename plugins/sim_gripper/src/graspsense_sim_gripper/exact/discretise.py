"""Deciding whether a grasp is discretised exactly, and computing the plant with its matrices."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.exact.modes import LinearScene, Shape
from graspsense_sim_gripper.exact.propagate import ExactPlant, workspace_size
from graspsense_sim_gripper.exact.tables import Tables, listed_tables_of, tables_of
from graspsense_sim_gripper.exact.term_states import n_numbers
from graspsense_sim_gripper.problem import GraspSetup
from graspsense_sim_gripper.terms.lumped import linear as lumped_form
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.term import LinearForm, OwnContact, TermParams

Forms = list[tuple[str, LinearForm | OwnContact | None]]
"""The kind and the linear form of each term; None as the form: not linear."""


def why_not_exact(config: SimConfig, setup: GraspSetup) -> str:
    """Return the reason why exact discretisation does not apply to a grasp, or an empty string if it applies.

    Raises TypeError if the linear form of a term has another number of states than its law.
    """
    return _why_not_exact_or_tables(config, setup, on_arrays=True)[0]


def _why_not_exact_or_tables(
    config: SimConfig, setup: GraspSetup, *, on_arrays: bool
) -> tuple[str, tuple[Shape, Tables] | None]:
    """Return the reason of `why_not_exact`, and the shape and the tables if there is none.

    This is the only place that decides between time steps and the matrix exponential. Time steps are prescribed by the
    settings, by a level of reduction that divides each tick, and by the fidelity `reference`.
    """
    drive, model, steps = setup.plant.drive, setup.plant.object, setup.plant.steps
    if config.has_forced_steps or steps.longest_s < math.inf or steps.settle > 0.0:
        return "the scheme or the length of its steps is prescribed", None
    if drive.link.finger_m != 0.0:
        return "the ratio of the linkage varies with the gap", None
    if drive.friction.breakaway_n != drive.friction.coulomb_n:
        return "friction is greater at rest than while sliding", None
    if model.held == 1 and setup.state.contact.offset_m != 0.0:
        return "the object is held off the centre line, so that each half would have modes of its own", None
    if model.pads.hardening_m < math.inf and model.pads.stiffness_n_m < math.inf:
        return "the pads are not linear", None
    forms = _forms(setup)
    nonlinear = [kind for kind, form in forms if form is None]
    if nonlinear:
        return f"terms are not linear: {', '.join(nonlinear)}", None
    found = _tables(setup, forms, on_arrays=on_arrays)
    return ("" if found is not None else "the forces leave the motion of a mode undetermined"), found


def discretise(
    config: SimConfig, setup: GraspSetup, *, on_arrays: bool = False
) -> tuple[ExactPlant, Shape] | None:
    """Return the plant with the matrices of its modes, and their shape; None if exact discretisation does not apply.

    `on_arrays`: store the matrices in arrays, for compiled code; otherwise in lists, which the interpreter indexes
    faster. Raises TypeError as `why_not_exact` does.
    """
    _, found = _why_not_exact_or_tables(config, setup, on_arrays=on_arrays)
    if found is None:
        return None
    shape, tables = found
    size = workspace_size(shape)
    workspace: Any = np.zeros(size) if on_arrays else [0.0] * size
    return ExactPlant(setup.plant, tables, workspace), shape


def _tables(setup: GraspSetup, forms: Forms, *, on_arrays: bool) -> tuple[Shape, Tables] | None:
    """Return the matrices of a grasp whose terms have these linear forms; None as `tables_of`."""
    drive, model = setup.plant.drive, setup.plant.object
    scene = LinearScene(
        drive.inertia / setup.state.motion.jacobian_m_rev**2,
        drive.friction.damping_n_s_m,
        drive.friction.breakaway_n > 0.0,
        drive.friction.load_friction_coefficient,
        drive.lag_s,
        model.pads,
        tuple(form for _, form in forms if form is not None),
    )
    return tables_of(scene, setup.dt_s) if on_arrays else listed_tables_of(scene, setup.dt_s)


def _forms(setup: GraspSetup) -> Forms:
    """Return the kind and the linear form of each term that the model keeps; None as the form: not linear.

    The lumped spring and damper comes first, with an empty kind.
    """
    lumped, *terms = setup.plant.object.terms
    forms: Forms = []
    if lumped.active == 1:
        forms.append(("", lumped_form(lumped.params)))
    forms += [
        (kind, _form(kind, term.params))
        for kind, term in zip(setup.kinds, terms, strict=True)
        if term.active == 1
    ]
    return forms


@lru_cache(maxsize=256)
def _form(kind: str, params: TermParams) -> LinearForm | OwnContact | None:
    """Return the linear form of a term, or None if it has none.

    Raises TypeError if the form has another number of states than the law.
    """
    term = find_term(kind)[1]
    form = term.linear(params)
    if form is None:
        return None
    n_states = n_numbers(term.at_rest)
    for part in (form.touching, form.parted) if isinstance(form, OwnContact) else (form,):
        if len(part.rates) not in (0, n_states):
            raise TypeError(
                f"term {kind!r}: its linear form has {len(part.rates)} states and the state of its law is "
                f"{term.at_rest!r}; give the form as many states as that has fields, all of them floats"
            )
    if isinstance(form, LinearForm) and not form.rates and n_states:
        # A form without rates leaves the states unchanged: their rates are zero.
        zeros = (0.0,) * n_states
        return form._replace(rates=(zeros,) * n_states, by_compression=zeros, by_speed=zeros, force=zeros)
    return form
