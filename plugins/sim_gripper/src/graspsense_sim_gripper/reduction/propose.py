"""Proposing the reduced model of a level: which terms are kept, replaced or dropped, and which scheme integrates it.

The object is compressed along three prescribed paths (see `probe`). A term may be dropped or replaced if this changes
the force on these paths by no more than the tolerance of the level. Decisions depend only on computed forces and
rates, not on the kinds of the terms, so a term that a plugin contributes is treated like any other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Final

from attrs import evolve

from graspsense.plugin_api import gap_and_rate, revolutions_at
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.dynamics.contact import ObjectModel, pad_compression
from graspsense_sim_gripper.dynamics.drive import Drive
from graspsense_sim_gripper.objects.spec import TermParams
from graspsense_sim_gripper.problem import GraspSetup, Problem
from graspsense_sim_gripper.reduction.candidates import named, simpler_pads, without_term
from graspsense_sim_gripper.reduction.levels import (
    BY_SCENE,
    FULL_SCALES,
    PLAIN_SCALES,
    UNVERIFIED,
    LevelScale,
    step_growth,
    step_tolerance,
    steps_for,
)
from graspsense_sim_gripper.reduction.model import DROPPED, KEPT, Reduction, TermDecision
from graspsense_sim_gripper.reduction.probe import Grip, damping, stiffness
from graspsense_sim_gripper.stepping.scheme import BOGACKI_SHAMPINE, MEAN_FORCE, TR_BDF2, VERLET, Steps
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.term import NO_STATE, Term, WorkingPoint, no_rates

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
"""An oscillation that needs more steps a tick is not resolved: its term is dropped, and the reduction says so."""
SCHEMES: Final = {
    VERLET: "Verlet",
    TR_BDF2: "TR-BDF2",
    MEAN_FORCE: "mean force",
    BOGACKI_SHAMPINE: "Bogacki-Shampine",
}


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


def propose(problem: Problem, grip: Grip, scale: LevelScale = UNVERIFIED) -> Reduction:
    """Return the reduced model for a level, without a trial grasp. Raises TypeError if there is no object.

    With a fidelity other than `scene`, every term is kept.
    """
    config, drive, dt_s = problem.model_config, _nominal(problem).plant.drive, _nominal(problem).dt_s
    if config.fidelity != "scene" and scale.model > 0.0:
        scale = FULL_SCALES[0]
    level = scale.at(config.accuracy)
    angle = min(math.sqrt(SWING_SHARE * level.step_tol), MAX_SWING_RAD)
    swings = _swings(grip, grip.model)
    too_fast = {i: per_s for i, per_s in swings.items() if per_s * dt_s > MOST_SWING_STEPS * angle}
    treatment, decisions, error, model = _reduce(grip, level.model_tol, too_fast)
    rate = (drive.friction.damping_n_s_m + damping(grip, model, dt_s)) / grip.mass_kg
    contact = _resolution(grip, dt_s, max(too_fast.values(), default=0.0))
    scheme = level.scheme
    if scheme == BY_SCENE:
        scheme = _scheme(config.accuracy, rate, contact.number / dt_s, dt_s, config.coulomb_n > 0.0)
    steps = _with_settings(steps_for(level, scheme, dt_s), config)
    fastest = max(_swings(grip, model).values(), default=0.0)
    if fastest > 0.0:
        steps = steps._replace(longest_touched_s=angle / fastest)
    return Reduction(
        accuracy=config.accuracy,
        treatment=treatment,
        point=grip.point,
        steps=steps,
        decisions=decisions,
        scheme=TermDecision(
            term="steps",
            decision=_scheme_in_words(scheme, level.plain, steps),
            what="damping rate times tick",
            number=rate * dt_s,
            error=config.accuracy * max(1.0 - scale.model, 0.0),
        ),
        contact=contact,
        error=error,
        oscillates=any(
            reduced.active == 1 and _oscillates(kind, full.params, grip.point)
            for kind, full, reduced in zip(grip.kinds, grip.model.terms[1:], model.terms[1:], strict=True)
        ),
        level=level,
    )


def fixed(problem: Problem) -> Reduction:
    """Return the model with every term and the scheme of the settings: nothing is computed in order to select it.

    The steps follow from the accuracy, or from `step_s`. Raises TypeError if there is no object.
    """
    config, setup = problem.model_config, _nominal(problem)
    kinds, params = setup.kinds, setup.terms
    level = FULL_SCALES[0].at(config.accuracy)
    steps = _with_settings(steps_for(level, VERLET, setup.dt_s), config)
    swings = _frequencies(kinds, setup.plant.object, USUAL_POINT)
    fastest = max(swings.values(), default=0.0)
    if fastest > 0.0:
        angle = min(math.sqrt(SWING_SHARE * level.step_tol), MAX_SWING_RAD)
        steps = steps._replace(longest_touched_s=max(angle / fastest, setup.dt_s / MOST_SWING_STEPS))
    what = "given by the settings"
    return Reduction(
        accuracy=config.accuracy,
        treatment=(KEPT,) * (len(kinds) + 1),
        point=USUAL_POINT,
        steps=steps,
        decisions=tuple(
            TermDecision(term=kind, decision=KEPT, what=what, number=0.0, error=0.0) for kind in kinds
        ),
        scheme=TermDecision(term="steps", decision=SCHEMES[steps.scheme], what=what, number=0.0, error=0.0),
        contact=TermDecision(term="contact", decision="not examined", what=what, number=0.0, error=0.0),
        error=0.0,
        oscillates=any(
            _oscillates(kind, term, USUAL_POINT) for kind, term in zip(kinds, params, strict=True)
        ),
        level=level,
    )


def plain(problem: Problem) -> Reduction:
    """Return the model with every term and a step per tick, without examining the object.

    Raises TypeError if there is no object.
    """
    level, dt_s = PLAIN_SCALES[0].at(problem.model_config.accuracy), _nominal(problem).dt_s
    steps = _with_settings(steps_for(level, VERLET, dt_s), problem.model_config)
    return evolve(fixed(problem), steps=steps, level=level)


def _mass_kg(drive: Drive, gap_m: float) -> float:
    """Return the mass (kg) that moves with the gap: the rotor's inertia through the linkage, J (2 pi)^2 / g^2."""
    _, jacobian = gap_and_rate(drive.link, revolutions_at(drive.link, gap_m))
    return drive.inertia / (jacobian * jacobian)


def _nominal(problem: Problem) -> GraspSetup:
    if problem.nominal is None:
        raise TypeError("where there is no object there is no model to reduce")
    return problem.nominal


def _scheme(accuracy: float, damping_rate: float, frequency: float, dt_s: float, has_friction: bool) -> int:
    """Return the scheme for this damping rate (1/s) and this angular frequency (rad/s) of the contact."""
    if damping_rate * dt_s > 1.0:
        return TR_BDF2
    # Velocity Verlet lets the energy of an oscillation vary. This matters only if the oscillation is hardly damped.
    undamped = frequency * (6.0 * step_tolerance(accuracy)) ** (2.0 / 3.0) / 4.0
    return MEAN_FORCE if damping_rate < undamped and not has_friction else VERLET


def _scheme_in_words(scheme: int, plain: int, steps: Steps) -> str:
    if steps.macro_tolerance > 0.0:
        return f"{SCHEMES[scheme]}, a step per tick; in batches over several ticks"
    return f"{SCHEMES[scheme]}, a step per tick" if plain == 1 else SCHEMES[scheme]


def _with_settings(steps: Steps, config: SimConfig) -> Steps:
    """Return the steps with the scheme, the length and the convergence that the settings prescribe."""
    if config.scheme != "auto":
        steps = steps._replace(scheme=(steps.scheme or TR_BDF2) if config.scheme == "implicit" else VERLET)
    if config.step_s is not None:
        steps = steps._replace(tolerance=math.inf, longest_s=float(config.step_s), growth=math.inf)
    if config.step_s is not None or config.drive_lag_s > 0.0 or config.acceleration:
        steps = steps._replace(macro_tolerance=0.0)
    if config.fidelity == "reference":
        steps = steps._replace(
            tolerance=min(steps.tolerance, step_tolerance(REFERENCE_ACCURACY)),
            settle=CONVERGED * config.accuracy,
            growth=min(steps.growth, step_growth(REFERENCE_ACCURACY)),
        )
    return steps


def _oscillates(kind: str, params: TermParams, point: WorkingPoint) -> bool:
    """Return whether a term has a state that oscillates, or a state without declared rates."""
    term = find_term(kind)[1]
    if term.rates is no_rates:
        return bool(term.at_rest != NO_STATE)
    return any(rate.what == "swings" for rate in term.rates(params, point))


def _swings(grip: Grip, model: ObjectModel) -> dict[int, float]:
    """Return the angular frequency (rad/s) of each term that this model keeps, by its index."""
    kept = _frequencies(grip.kinds, grip.model, grip.point)
    return {i: per_s for i, per_s in kept.items() if model.terms[i + 1].active == 1}


def _frequencies(kinds: Sequence[str], model: ObjectModel, point: WorkingPoint) -> dict[int, float]:
    """Return the angular frequency (rad/s) of each term by its index, 0 if it does not oscillate.

    A term that divides its steps by itself is left out.
    """
    swings = {}
    for i, kind in enumerate(kinds):
        term, params = find_term(kind)[1], model.terms[i + 1].params
        if not term.divides_steps:
            swings[i] = max((r.per_s for r in term.rates(params, point) if r.what == "swings"), default=0.0)
    return swings


def _resolution(grip: Grip, dt_s: float, too_fast_per_s: float) -> TermDecision:
    """Return whether the force trace of the contact is resolved, and its natural frequency times the tick.

    `too_fast_per_s`: the frequency of a term that is too fast to be resolved, 0 if none is.
    """
    within_tick, at_once = stiffness(grip, dt_s)
    number = max(math.sqrt(max(within_tick, 0.0) / grip.mass_kg), too_fast_per_s) * dt_s
    resolved = max(within_tick, at_once) <= 1.05 * STIFFEST_N_M and number <= 1.05
    return TermDecision(
        term="contact",
        decision="trace resolved" if resolved else NOT_VERIFIED,
        what="natural frequency times tick",
        number=number,
        error=0.0 if resolved else math.inf,
    )


def _reduce(
    grip: Grip, max_error: float, too_fast: Iterable[int] = ()
) -> tuple[tuple[str, ...], tuple[TermDecision, ...], float, ObjectModel]:
    """Return the treatment of each term and of the pads, the decisions, their joint error, and the reduced model.

    The joint error is the relative change of the force on the probe paths; it is at most `max_error`.
    `too_fast`: the indices of terms that are dropped, whatever the error.
    """
    kinds, point = grip.kinds, grip.point
    treatment, errors, spent, model = [KEPT] * (len(kinds) + 1), [0.0] * len(kinds), 0.0, grip.model
    decisions: list[TermDecision] = []
    for i in too_fast:
        treatment[i], errors[i] = DROPPED, math.inf
        model = named(DROPPED, without_term(model, kinds, i, point))
    if max_error > 0.0:
        alternatives = grip.alternatives()
        # The terms that matter least are decided first; each gets its cheapest candidate within the tolerance.
        for i in sorted(range(len(kinds)), key=lambda i: min(error for _, error in alternatives[i])):
            for name, error_alone in alternatives[i] if treatment[i] == KEPT else ():
                if error_alone > max_error:
                    continue
                other = named(name, without_term(model, kinds, i, point))
                error = grip.error_of(other, max_error)
                if error <= max_error:
                    treatment[i], errors[i], model, spent = name, error_alone, other, error
                    break
        for name, other in simpler_pads(model):
            error = grip.error_of(other, max_error)
            if error <= max_error:
                treatment[-1], model = name, other
                decisions.append(_pads_decision(grip, name, abs(error - spent)))
                spent = error
                break
    decisions += _term_decisions(grip, treatment, errors)
    return tuple(treatment), tuple(decisions), spent, model


def _pads_decision(grip: Grip, name: str, error: float) -> TermDecision:
    """Return the decision on the pads; `error` is the change of the joint error that it causes."""
    share = pad_compression(grip.model.pads, grip.forces[0][-1]) / max(grip.point.compression_m, 1e-9)
    what = "their compression over the total compression"
    return TermDecision(term="pads", decision=name, what=what, number=share, error=error)


def _term_decisions(grip: Grip, treatment: Sequence[str], errors: Sequence[float]) -> list[TermDecision]:
    decisions = []
    for i, kind in enumerate(grip.kinds):
        what, number = _deciding(find_term(kind)[1], grip.model.terms[i + 1].params, grip.point)
        decision = treatment[i] if treatment[i] in (KEPT, DROPPED) else f"limit: {treatment[i]}"
        decisions.append(
            TermDecision(term=kind, decision=decision, what=what, number=number, error=errors[i])
        )
    return decisions


@lru_cache(maxsize=256)
def _deciding(term: Term, params: TermParams, point: WorkingPoint) -> tuple[str, float]:
    """Return the number that characterises a term best, and its meaning.

    It is the fastest rate times the duration of the grasp, or, without rates, the force over the gripping force.
    """
    rates = term.rates(params, point)
    if rates:
        fastest = max(rates, key=lambda rate: rate.per_s)
        return f"rate ({fastest.what}) times duration of the grasp", fastest.per_s * point.seconds
    return "force over gripping force", term.importance(params, point) / point.force_n
