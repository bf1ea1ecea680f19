"""A tick that is repeated in shorter steps until its end no longer changes, for a reference or a tight tolerance."""

from __future__ import annotations

from typing import Final

from graspsense_sim_gripper.plant.state import right_of
from graspsense_sim_gripper.solve.advance import rests, take_steps
from graspsense_sim_gripper.solve.coast import SHAPE_SCALE_M, coast
from graspsense_sim_gripper.solve.control import MAX_STEPS, fits_a_step
from graspsense_sim_gripper.solve.scheme import (
    FORCE_SCALE_N,
    SPEED_SCALE_M_S,
    PlantParams,
    PlantState,
    Steps,
    StepState,
    with_step,
)

MAX_HALVINGS: Final = 4
"""Halvings after which a change of `LOOSE` times the tolerance is accepted too."""
LOOSE: Final = 1e4
LAST_HALVING: Final = 10
"""After so many halvings the tick is accepted in any case, and counted as unresolved if it has not converged."""
ERROR_RATIO: Final = 0.125
"""Ratio of the error of a step to that of a step of half the length."""
MIN_TOLERANCE: Final = 1e-8
"""Smallest tolerance that halving uses. Below it the error of a step is rounding, which shorter steps increase."""


def refine_until_converged(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return what `advance` does, from steps that are halved until the end of the tick has converged.

    The state before the tick has to be kept for this, which costs compiled code 5 % where no tick is refined.
    """
    drive, model, steps = params
    if state.motion.speed_rev_s == 0.0:
        if rests(drive, state, effort_n):
            return state
    elif steps.settle <= 0.0 and fits_a_step(steps, state.step, dt):
        coasts, finer = coast(params, steps.tolerance, state, effort_n, dt)
        if coasts:
            return finer
    coarser = finer = state
    n_before = n_halvings = 0
    while True:
        finer, n = take_steps(PlantParams(drive, model, steps), state, effort_n, dt)
        if steps.settle <= 0.0 or (finer.contact.touched == 0 and finer.motion.speed_rev_s == 0.0):
            return finer
        # The steps of the next attempt are the same if half of the tick was their limit already.
        if n > n_before > 0 and _alike(coarser, finer, steps.settle):
            return finer
        # Steps of half the length would be too many, and too short to be of use.
        too_many = 4 * n > MAX_STEPS
        if too_many or n_halvings >= MAX_HALVINGS:
            converged = n_halvings > 0 and _alike(coarser, finer, LOOSE * steps.settle)
            if converged or too_many or n_halvings >= LAST_HALVING:
                return finer if converged else _unresolved(finer)
        steps = _halved(steps, dt)
        coarser, n_before, n_halvings = finer, n, n_halvings + 1


def _unresolved(state: PlantState) -> PlantState:
    """Return the plant after a tick that has not converged."""
    next_s, n, unresolved = state.step
    return with_step(state, StepState(next_s, n, unresolved + 1))


def _alike(coarser: PlantState, finer: PlantState, share: float) -> bool:
    """Return whether speed, force and shapes agree within this relative tolerance."""
    speed0 = coarser.motion.speed_rev_s * coarser.motion.jacobian_m_rev
    speed1 = finer.motion.speed_rev_s * finer.motion.jacobian_m_rev
    force0 = coarser.contact.left_n + coarser.contact.right_n
    force1 = finer.contact.left_n + finer.contact.right_n
    # The shape of a released object affects no force until the object touches the fingers again.
    left0, left1 = coarser.contact.left.compression_m, finer.contact.left.compression_m
    right0, right1 = (
        right_of(coarser.contact.left, coarser.contact.right).compression_m,
        right_of(finer.contact.left, finer.contact.right).compression_m,
    )
    return (
        abs(speed1 - speed0) <= share * max(abs(speed1), SPEED_SCALE_M_S)
        and abs(force1 - force0) <= share * max(force1, FORCE_SCALE_N)
        and abs(left1 - left0) <= share * max(abs(left1), SHAPE_SCALE_M)
        and abs(right1 - right0) <= share * max(abs(right1), SHAPE_SCALE_M)
    )


def _halved(steps: Steps, dt: float) -> Steps:
    """Return steps of half the length, also where the end of the tick `dt` cut them."""
    return Steps(
        tolerance=max(ERROR_RATIO * steps.tolerance, min(steps.tolerance, MIN_TOLERANCE)),
        longest_s=0.5 * min(steps.longest_s, dt),
        settle=steps.settle,
        growth=1.0 + 0.5 * (steps.growth - 1.0),
        longest_touched_s=0.5 * min(steps.longest_touched_s, dt),
        macro_tolerance=0.0,
    )
