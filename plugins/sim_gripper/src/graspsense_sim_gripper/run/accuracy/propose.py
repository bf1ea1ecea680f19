"""Proposing the steps of a level, and what they cannot resolve.

The object is compressed along two prescribed paths (see `probe`). Decisions depend only on computed forces and rates,
not on the kinds of the terms, so a term that a plugin contributes is treated like any other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from attrs import evolve

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.contact import ObjectModel
from graspsense_sim_gripper.plant.drive import Drive
from graspsense_sim_gripper.run.accuracy.levels import (
    CONTROLLED,
    PLAIN,
    LevelScale,
    step_growth,
    step_tolerance,
    steps_for,
)
from graspsense_sim_gripper.run.accuracy.model import QUANTITIES, Reduction, StepDecision
from graspsense_sim_gripper.run.accuracy.probe import Grip, damping, stiffness
from graspsense_sim_gripper.run.problem import GraspSetup, Problem
from graspsense_sim_gripper.scene.spec import TermParams
from graspsense_sim_gripper.scene.terms.registry import find_term
from graspsense_sim_gripper.scene.terms.switchable import Switchable, switched_off
from graspsense_sim_gripper.scene.terms.term import NO_STATE, Term, WorkingPoint, no_rates
from graspsense_sim_gripper.solve.scheme import Steps

FORCE_N: Final = 20.0
SPEED_M_S: Final = 0.01
"""The gripping force and the closing speed that are assumed without other information: those of the paper (Chitta,
Piccoli and Sturm, ICRA 2010)."""
USUAL_POINT: Final = WorkingPoint(1e-3, SPEED_M_S, 1.0, FORCE_N)
"""The working point that the rates of terms are given for where nothing is selected."""
REFERENCE_ACCURACY: Final = 1e-3
"""The steps of a reference begin with the tolerance for this accuracy, or for a finer one that is requested."""
CONVERGED: Final = 1e-7
"""A reference halves the steps of a tick until speed and force change by less than this times the accuracy."""
NOT_VERIFIED: Final = "trace not verified"
"""The decision on a contact that is too stiff or too fast for trial grasps: it bounces within a tick, so peaks are
near those of the reference, but the time course between bounces is not."""
STIFFEST_N_M: Final = 1e6
"""The largest contact stiffness (N/m) for which peak forces agree with those of the reference."""
SWING_SHARE: Final = 10.0
MAX_SWING_RAD: Final = 1.0
"""The angle of the fastest oscillation of a term over a step: the square root of this share of the accuracy, at most
one radian. Longer steps see an oscillation at a few phases only, and the error estimate does not notice it."""
MOST_SWING_STEPS: Final = 500
"""An oscillation that needs more steps a tick is not resolved: its term is left out, and the report says so."""
PERIOD_RAD: Final = 2.0 * math.pi
"""An oscillation with a period within a tick is computed, but nothing is verified: the finest trial grasps may miss it
too, and agree."""


def grip_of(problem: Problem, force_n: float | None = None, speed_m_s: float | None = None) -> Grip:
    """Return the nominal object with its probe paths, for this gripping force (N) and this speed at the contact (m/s).

    `expected_force_n` and `expected_speed_m_s` of the settings take precedence over the arguments. Without either, the
    values of the paper are used. Raises TypeError if there is no object.
    """
    config, setup = problem.model_config, _nominal(problem)
    drive = setup.plant.drive
    return Grip(
        setup.plant.object,
        setup.kinds,
        config.expected_force_n or force_n or FORCE_N,
        config.expected_speed_m_s or speed_m_s or SPEED_M_S,
        _mass_kg(drive, min(max(setup.plant.object.width_m, 0.0), config.open_gap_m)),
    )


def propose(problem: Problem, grip: Grip, scale: LevelScale = CONTROLLED[0]) -> Reduction:
    """Return the steps of a level, without a trial grasp. Raises TypeError if there is no object."""
    config, drive, dt_s = problem.model_config, _nominal(problem).plant.drive, _nominal(problem).dt_s
    level = scale.at(config.accuracy)
    angle = min(math.sqrt(SWING_SHARE * level.step_tol), MAX_SWING_RAD)
    swings = _frequencies(grip.kinds, grip.model, grip.point)
    too_fast = {i: per_s for i, per_s in swings.items() if per_s * dt_s > MOST_SWING_STEPS * angle}
    within_tick = any(per_s * dt_s > PERIOD_RAD for per_s in swings.values())
    model = grip.model._replace(terms=switched_off(grip.model.terms, tuple(too_fast)))
    damping_rate = (drive.friction.damping_n_s_m + damping(grip, model, dt_s)) / grip.mass_kg
    stiffnesses = stiffness(grip, dt_s)
    frequency = max(math.sqrt(max(stiffnesses[0], 0.0) / grip.mass_kg), *too_fast.values(), 0.0) * dt_s
    resolved = max(stiffnesses) <= 1.05 * STIFFEST_N_M and frequency <= 1.05
    steps = _with_settings(steps_for(level, dt_s), config)
    fastest = max((per_s for i, per_s in swings.items() if i not in too_fast), default=0.0)
    if fastest > 0.0:
        steps = steps._replace(longest_touched_s=angle / fastest)
    return Reduction(
        accuracy=config.accuracy,
        point=grip.point,
        steps=steps,
        decisions=(
            StepDecision(
                subject="steps",
                decision=_in_words(steps, dt_s),
                what="damping rate times tick",
                number=damping_rate * dt_s,
            ),
            StepDecision(
                subject="contact",
                decision="trace resolved" if resolved else NOT_VERIFIED,
                what="natural frequency times tick",
                number=frequency,
            ),
            *(
                StepDecision(
                    subject=grip.kinds[i],
                    decision="left out: its oscillation is not resolved",
                    what="angle in a tick (rad)",
                    number=per_s * dt_s,
                )
                for i, per_s in too_fast.items()
            ),
        ),
        frequency=frequency,
        is_stiff=damping_rate * dt_s > 1.0,
        unresolved=QUANTITIES if within_tick else () if resolved else QUANTITIES[1:],
        left_out=tuple(too_fast),
        oscillates=_any_oscillates(grip.kinds, model.terms, grip.point),
        level=level,
    )


def fixed(problem: Problem) -> Reduction:
    """Return the steps that follow from the accuracy, or from `step_s`, without examining the object.

    Raises TypeError if there is no object.
    """
    config, setup = problem.model_config, _nominal(problem)
    level = CONTROLLED[0].at(config.accuracy)
    steps = _with_settings(steps_for(level, setup.dt_s), config)
    swings = _frequencies(setup.kinds, setup.plant.object, USUAL_POINT)
    fastest = max(swings.values(), default=0.0)
    if fastest > 0.0:
        angle = min(math.sqrt(SWING_SHARE * level.step_tol), MAX_SWING_RAD)
        steps = steps._replace(longest_touched_s=max(angle / fastest, setup.dt_s / MOST_SWING_STEPS))
    what = "given by the settings"
    return Reduction(
        accuracy=config.accuracy,
        point=USUAL_POINT,
        steps=steps,
        decisions=(
            StepDecision(subject="steps", decision=_in_words(steps, setup.dt_s), what=what, number=0.0),
            StepDecision(subject="contact", decision="not examined", what=what, number=0.0),
        ),
        frequency=0.0,
        is_stiff=False,
        unresolved=(),
        left_out=(),
        oscillates=_any_oscillates(setup.kinds, setup.plant.object.terms, USUAL_POINT),
        level=level,
    )


def plain(problem: Problem) -> Reduction:
    """Return a step per tick, without examining the object.

    Raises TypeError if there is no object.
    """
    level, dt_s = PLAIN.at(problem.model_config.accuracy), _nominal(problem).dt_s
    steps = _with_settings(steps_for(level, dt_s), problem.model_config)
    return evolve(fixed(problem), steps=steps, level=level)


def _mass_kg(drive: Drive, gap_m: float) -> float:
    """Return the mass (kg) that moves with the gap: the rotor's inertia through the linkage, J (2 pi)^2 / g^2."""
    _, jacobian = gap_and_rate(drive.link, revolutions_at(drive.link, gap_m))
    return drive.inertia / (jacobian * jacobian)


def _nominal(problem: Problem) -> GraspSetup:
    if problem.nominal is None:
        raise TypeError("where there is no object there is no model to reduce")
    return problem.nominal


def _in_words(steps: Steps, dt_s: float) -> str:
    if steps.macro_tolerance > 0.0:
        return "a step per tick; in batches over several ticks"
    if steps.tolerance < math.inf:
        return "by their error"
    return "a step per tick" if steps.longest_s == dt_s else f"of {steps.longest_s:g} s"


def _with_settings(steps: Steps, config: SimConfig) -> Steps:
    """Return the steps with the length and the convergence that the settings prescribe."""
    if config.step_s is not None:
        steps = steps._replace(tolerance=math.inf, longest_s=float(config.step_s), growth=math.inf)
    if config.step_s is not None or config.drive_lag_s > 0.0:
        steps = steps._replace(macro_tolerance=0.0)
    if config.fidelity == "reference":
        steps = steps._replace(
            tolerance=min(steps.tolerance, step_tolerance(REFERENCE_ACCURACY)),
            settle=CONVERGED * config.accuracy,
            growth=min(steps.growth, step_growth(REFERENCE_ACCURACY)),
        )
    return steps


def _any_oscillates(kinds: Sequence[str], terms: Sequence[Switchable], point: WorkingPoint) -> bool:
    """Return whether an active term has a state that oscillates, or a state without declared rates."""
    return any(
        term.active == 1 and _oscillates(find_term(kind)[1], term.params, point)
        for kind, term in zip(kinds, terms, strict=True)
    )


def _oscillates(term: Term, params: TermParams, point: WorkingPoint) -> bool:
    if term.rates is no_rates:
        return bool(term.at_rest != NO_STATE)
    return any(rate.what == "swings" for rate in term.rates(params, point))


def _frequencies(kinds: Sequence[str], model: ObjectModel, point: WorkingPoint) -> dict[int, float]:
    """Return the angular frequency (rad/s) of each term by its index, 0 if it does not oscillate.

    A term that divides its steps by itself is left out.
    """
    swings = {}
    for i, kind in enumerate(kinds):
        term, params = find_term(kind)[1], model.terms[i].params
        if not term.divides_steps:
            swings[i] = max((r.per_s for r in term.rates(params, point) if r.what == "swings"), default=0.0)
    return swings
