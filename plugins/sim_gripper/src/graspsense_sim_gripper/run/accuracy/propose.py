"""Proposing the steps of a level, and what they cannot resolve: from how stiff the contact of an object is.

The object is compressed slowly, up to the force of a grasp.

Decisions depend only on computed forces and rates, not on the kinds of the terms, so a term that a plugin contributes
is treated like any other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.run.accuracy.chosen_steps import QUANTITIES, ChosenSteps, StepDecision
from graspsense_sim_gripper.run.accuracy.levels import (
    CONTROLLED,
    MAX_BALANCE_RTOL,
    LevelScale,
    step_growth,
    step_tolerance,
    steps_for,
)
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.compiled.compose import contact_solver, uncompressed
from graspsense_sim_gripper.scene.terms.registry import find_term
from graspsense_sim_gripper.scene.terms.term import NO_STATE, Switchable, Term, WorkingPoint
from graspsense_sim_gripper.solve.scheme import Steps

FORCE_N: Final = 20.0
SPEED_M_S: Final = 0.01
"""The gripping force and the closing speed that are assumed without other information: those of the paper (Chitta,
Piccoli and Sturm, ICRA 2010)."""
FIRST_M: Final = 1e-6
GROWTH: Final = 1.5
"""The first closure, and the ratio of each closure to the one before."""
POINT_S: Final = 0.1
"""Duration of each step from one closure to the next: what relaxes during a squeeze has relaxed."""
FURTHER: Final = 0.1
"""The share of a closure by which the fingers go further within a tick."""
MAX_DEPTH: Final = 0.9
"""No object is compressed by more than this share of its width."""


class Grip(NamedTuple):
    """What a grasp of the nominal object is expected to meet."""

    force_n: float
    mass_kg: float
    """The mass that moves with the gap: the inertia of the rotor through the linkage."""
    stiffness_n_m: float
    """The largest stiffness over a tick: the force after a further motion within a tick, less that after a tick at
    rest, over this motion."""
    touch_n_m: float
    """The stiffness at the first touch, where rigid pads meet the surface of the object alone."""


def grip_of(problem: Problem, force_n: float = FORCE_N) -> Grip:
    """Return what a grasp with this peak force (N) meets. Raises TypeError if there is no object."""
    setup = problem.nominal
    drive, model = setup.plant.drive, setup.plant.object
    # Only orders of magnitude follow from the forces, so their balance need not be that of a reference.
    model = model._replace(balance_rtol=MAX_BALANCE_RTOL)
    press, untouched = contact_solver(setup.kinds), uncompressed(setup.kinds)
    contact, last_closure, closure, largest = untouched, 0.0, FIRST_M, 0.0
    while closure < MAX_DEPTH * model.width_m and contact.force_n < force_n:
        contact, _ = press(model, contact, closure, (closure - last_closure) / POINT_S, POINT_S)
        rests, further = (
            press(model, contact, closure * share, 0.0, setup.dt_s)[0].force_n
            for share in (1.0, 1.0 + FURTHER)
        )
        rise = (further - rests) / (FURTHER * closure)
        if math.isfinite(rise):  # a law without a finite force ends the grasp, with its own reason
            largest = max(largest, rise)
        last_closure, closure = closure, GROWTH * closure
    touch, _ = press(model, untouched, FIRST_M, 0.0, 0.0)
    _, jacobian = gap_and_rate(
        drive.link, revolutions_at(drive.link, min(max(model.width_m, 0.0), problem.config.open_gap_m))
    )
    return Grip(
        force_n=force_n,
        mass_kg=drive.inertia / (jacobian * jacobian),
        stiffness_n_m=largest,
        touch_n_m=touch.force_n / FIRST_M,
    )


USUAL_POINT: Final = WorkingPoint(1e-3, SPEED_M_S, 1.0, FORCE_N)
"""The working point that the rates of terms are given for."""
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
"""An oscillation that needs more steps a tick for the requested accuracy is not resolved: its term is left out, and the
report says so."""
PERIOD_RAD: Final = 2.0 * math.pi
"""An oscillation with a period within a tick is computed, but nothing is verified: the finest trial grasps may miss it
too, and agree."""


def propose(problem: Problem, grip: Grip | None, scale: LevelScale = CONTROLLED[0]) -> ChosenSteps:
    """Return the steps of a level, without a trial grasp; `grip` None: the object is not examined.

    Raises TypeError if there is no object.
    """
    config, setup = problem.model_config, problem.nominal
    kinds, model, dt_s = setup.kinds, setup.plant.object, setup.dt_s
    level = scale.level(config.accuracy)
    swings = _frequencies(kinds, model)
    # The same at every level: two levels that both leave a term out would agree.
    highest_per_s = MOST_SWING_STEPS * _swing_angle(config.accuracy) / dt_s
    too_fast: dict[int, float] = {}
    if grip is not None:
        too_fast = {i: per_s for i, per_s in swings.items() if per_s > highest_per_s}
    steps = _with_settings(steps_for(level, dt_s), config)
    fastest = max((per_s for i, per_s in swings.items() if i not in too_fast), default=0.0)
    if fastest > 0.0:
        touched_s = _swing_angle(level.step_tol) / min(fastest, highest_per_s)
        steps = steps._replace(longest_touched_s=min(steps.longest_touched_s, touched_s))
    unresolved: tuple[str, ...] = ()
    frequency, contact = 0.0, "not examined"
    if grip is not None:
        natural = math.sqrt(max(grip.stiffness_n_m, 0.0) / grip.mass_kg)
        frequency = max(natural, *too_fast.values(), 0.0) * dt_s
        stiffest = max(grip.stiffness_n_m, grip.touch_n_m)
        bounces = not (stiffest <= 1.05 * STIFFEST_N_M and frequency <= 1.05)
        within_tick = any(per_s * dt_s > PERIOD_RAD for per_s in swings.values())
        unresolved = QUANTITIES if within_tick else QUANTITIES[1:] if bounces else ()
        contact = NOT_VERIFIED if bounces else "trace resolved"
    decisions = [
        ("steps", _in_words(steps, dt_s), "accuracy of the steps", level.step_tol),
        ("contact", contact, "natural frequency times tick", frequency),
        *(
            (kinds[i], "left out: its oscillation is not resolved", "angle in a tick (rad)", per_s * dt_s)
            for i, per_s in too_fast.items()
        ),
    ]
    return ChosenSteps(
        accuracy=config.accuracy,
        force_n=FORCE_N if grip is None else grip.force_n,
        steps=steps,
        decisions=tuple(StepDecision(*decision) for decision in decisions),
        frequency=frequency,
        unresolved=unresolved,
        left_out=tuple(too_fast),
        oscillates=any(map(_oscillates, kinds, model.terms)),
        level=level,
    )


def _swing_angle(accuracy: float) -> float:
    """Return the largest angle (rad) of the fastest oscillation over a step."""
    return min(math.sqrt(SWING_SHARE * accuracy), MAX_SWING_RAD)


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


def _oscillates(kind: str, term: Switchable) -> bool:
    """Return whether a term is active and has a state that oscillates, or a state without declared rates."""
    law = find_term(kind)[1]
    if law.rates is None:
        return term.active == 1 and bool(law.at_rest != NO_STATE)
    return term.active == 1 and bool(_swings(law, term))


def _swings(law: Term, term: Switchable) -> list[float]:
    """Return the angular frequencies (rad/s) with which a term oscillates."""
    rates = law.rates(term.params, USUAL_POINT) if law.rates else ()
    return [rate.per_s for rate in rates if rate.what == "swings"]


def _frequencies(kinds: Sequence[str], model: ObjectModel) -> dict[int, float]:
    """Return the angular frequency (rad/s) of each term by its index, 0 if it does not oscillate.

    A term that divides its steps by itself is left out.
    """
    laws = [find_term(kind)[1] for kind in kinds]
    return {
        i: max(_swings(law, model.terms[i]), default=0.0)
        for i, law in enumerate(laws)
        if not law.divides_steps
    }
