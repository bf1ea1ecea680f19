"""Selecting the steps of the grasps of an object: the first level whose trial grasp is accurate enough.

A trial grasp in finer steps gives the peak force. Then the steps of one level after
another are compared with finer ones: first a step per tick, since it costs least, then steps whose error is controlled,
for the accuracy, a tenth and a hundredth of it.

Steps that pass are compared with still finer ones too. A controller may meet a threshold so closely that two grasps are
on the wrong side of it together, which steps with a tenth of their error show. If no level passes, no steps have the
accuracy, and ConfigError says so.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from typing import Final

from attrs import evolve

from graspsense.plugin_api import ConfigError
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.cache import find, keep, key_of
from graspsense_sim_gripper.run.accuracy.chosen_steps import (
    QUANTITIES,
    ChosenSteps,
    StepDecision,
    Verification,
)
from graspsense_sim_gripper.run.accuracy.error import NOT_READ, GraspRecord, deviation
from graspsense_sim_gripper.run.accuracy.levels import CONTROLLED, PLAIN, REFERENCE_SCALES, LevelScale
from graspsense_sim_gripper.run.accuracy.propose import FORCE_N, Grip, grip_of, propose
from graspsense_sim_gripper.run.accuracy.verify import (
    MOST_WORK,
    TooMuchWork,
    TrialGrasps,
    trial_grasps,
    without_term,
)
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.problem import GraspController
from graspsense_sim_gripper.run.term_failure import TermFailed
from graspsense_sim_gripper.scene.spec import ObjectSpec
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS

ACCEPTED_WITH_SPREAD: Final = 0.5
ACCEPTED: Final = 0.8
"""Steps are accepted if the trial grasps differ by at most this share of the accuracy. With spread, the rest allows
for the differences between instances. Without spread, it allows for pad sensors and the errors of the trial grasps."""
FINE: Final = 0.003
"""Down from this accuracy, the grasp to compare with takes twice as many steps per tick, because one of two grasps may
resolve a short contact that the other misses."""
CULPRIT: Final = 0.2
"""A term is named as the cause of an error if less than this share of the error remains without the term."""

MOST_FOR_FEATURES: Final = 2
"""Further models that are tried where features of the pipeline are less accurate than those of the paper. A feature
that shorter steps do not give is one that depends on ticks."""


def select(
    problem: Problem,
    controller: GraspController,
    *,
    compiled: bool = False,
    padding: tuple[str, ...] | None = None,
) -> ChosenSteps:
    """Return the steps for a problem's object, verified by trial grasps under the controller.

    They are cached in memory and on disk, by everything that they depend on. They are not verified, and their
    `verification` is None, if the settings prescribe the steps or ask for the reference, if the controller or a term
    fails in the first trial grasp, if something cannot be resolved (`ChosenSteps.unresolved`), or if the trial grasps
    would take too much work (`MOST_WORK`).

    `compiled`: run the trial grasps compiled, if the controller can be compiled. `padding`: the kinds of terms in the
    compiled code, by default those of a batch. Both change the run time only.

    Raises ConfigError if no steps reach the requested accuracy, TypeError if there is no object.
    """
    if problem.config.fidelity == "fixed":
        return propose(problem, None)
    key = key_of(problem, controller)
    chosen = find(key)
    if chosen is None:
        trial = trial_grasps(problem, controller, compiled=compiled, padding=padding)
        chosen = _select_within_limit(problem, trial)
        keep(key, chosen)
    return chosen


def _select_within_limit(problem: Problem, trial: TrialGrasps) -> ChosenSteps:
    """Return the steps as `_select` does, or unverified ones if the trial grasps take too much work."""
    try:
        return _select(problem, trial)
    except TooMuchWork:
        chosen = propose(problem, grip_of(problem))
    limit = StepDecision(
        subject="trial grasps",
        decision="stopped at the limit: not verified",
        what="ticks and steps",
        number=float(MOST_WORK),
    )
    return evolve(chosen, decisions=(*chosen.decisions, limit), unresolved=QUANTITIES)


def _select(problem: Problem, trial: TrialGrasps) -> ChosenSteps:
    """Return the model as `select` does, without the cache."""
    config = problem.model_config
    usual = grip_of(problem)
    unverified = propose(problem, usual)
    prescribed = config.step_s is not None or config.fidelity == "reference"
    if prescribed or unverified.unresolved:
        return unverified
    finer = propose(problem, usual, _reference_scale(config, CONTROLLED[0]))
    force_n = _felt(trial, finer)
    if not math.isfinite(force_n):
        return unverified
    grip = grip_of(problem, force_n or FORCE_N)
    unverified = propose(problem, grip)
    return unverified if unverified.unresolved else _best(problem, grip, trial)


def _felt(trial: TrialGrasps, chosen: ChosenSteps) -> float:
    """Return the peak force of a trial grasp in these steps, to two digits, so that similar grasps share a proposal.

    NaN if the grasp fails; what failed does so in the grasp of the run as well, and is reported there. Raises
    TooMuchWork.
    """
    try:
        grasp = trial.record(chosen)
    except TooMuchWork:
        raise
    except Exception:
        return math.nan
    return float(f"{grasp.peak_n:.1e}")


def _best(problem: Problem, grip: Grip, trial: TrialGrasps) -> ChosenSteps:
    """Return the first accepted model in which the features of the pipeline are accurate too, or else the first.

    Raises ConfigError if no model is accepted.
    """
    accepted = _accepted(problem, grip, trial)
    fastest = next(accepted)
    if fastest.not_verified in ((), NOT_READ):
        return fastest
    further = islice(accepted, MOST_FOR_FEATURES)
    return next((model for model in further if not model.not_verified), fastest)


def _accepted(problem: Problem, grip: Grip, trial: TrialGrasps) -> Iterator[ChosenSteps]:
    """Yield the models that trial grasps accept, the fastest first. Raises ConfigError if there is none."""
    config = problem.model_config
    share, least, grasps, n_accepted = _accepted_share(config), (math.inf, ""), 1, 0
    for scale in (*PLAIN, *CONTROLLED):
        chosen = propose(problem, grip, scale)
        full = propose(problem, grip, _reference_scale(config, scale))
        error, quantity = _off(trial, chosen, trial.record(full))
        grasps += 1
        if error <= share * config.accuracy:
            features = trial.features_beyond(chosen, full)
            verification = Verification(error=error, quantity=quantity, grasps=grasps, features=features)
            if scale.plain == 1 and config.spread:
                accepted = _accepted_for_instances(problem, chosen, full, trial, verification)
            else:
                error, quantity = _confirmed(problem, grip, trial, chosen, scale)
                fits = error <= config.accuracy
                accepted = evolve(chosen, verification=verification) if fits else None
            if accepted:
                n_accepted += 1
                yield accepted
                continue
        least = min(least, (error, quantity))
    if n_accepted == 0:
        raise ConfigError(_refusal(problem, *least, _culprit(problem, grip, trial)))


def _off(trial: TrialGrasps, chosen: ChosenSteps, expected: GraspRecord) -> tuple[float, str]:
    """Return how far a grasp in these steps is from the expected one, as `deviation` does; inf if it fails."""
    try:
        return deviation(trial.record(chosen), expected)
    except (TermFailed, *LAW_ERRORS):
        return math.inf, "outcome"


def _confirmed(
    problem: Problem, grip: Grip, trial: TrialGrasps, chosen: ChosenSteps, scale: LevelScale
) -> tuple[float, str]:
    """Return how far the grasp is from one in still smaller steps than those that it was compared with."""
    finer = scale._replace(refinement=min(10.0 * scale.refinement, max(REFERENCE_SCALES)))
    exact = trial.record(propose(problem, grip, _reference_scale(problem.model_config, finer)))
    return deviation(trial.record(chosen), exact)


def _accepted_for_instances(
    problem: Problem, chosen: ChosenSteps, full: ChosenSteps, trial: TrialGrasps, verification: Verification
) -> ChosenSteps | None:
    """Return a model, verified by grasps of some instances; None if it is not accurate enough for one of them.

    `full` is the model to compare with, and `verification` the result for the nominal object. The expected force of the
    returned model is the largest peak force of all these grasps.
    """
    force_n = chosen.force_n
    for setup in problem.examples():
        trial = trial.with_setup(setup)
        try:
            grasp, expected = trial.record(chosen), trial.record(full)
        except Exception:
            # A single instance that fails, or takes too much work, is no reason to refuse the object.
            return None
        error, quantity = deviation(grasp, expected)
        if error > _accepted_share(problem.model_config) * problem.model_config.accuracy:
            return None
        features = dict.fromkeys((*verification.features, *trial.features_beyond(chosen, full)))
        if error > verification.error:
            verification = evolve(verification, error=error, quantity=quantity)
        verification = evolve(verification, grasps=verification.grasps + 1, features=tuple(features))
        force_n = max(force_n, grasp.peak_n)
    return evolve(chosen, verification=verification, force_n=force_n)


def _reference_scale(config: SimConfig, scale: LevelScale) -> LevelScale:
    """Return the scale of the steps that a candidate of this scale is compared with."""
    reference = REFERENCE_SCALES[scale.refinement]
    factor = 2 if config.accuracy <= FINE else 1
    return reference._replace(min_steps=factor * reference.min_steps)


def _accepted_share(config: SimConfig) -> float:
    """Return the share of the accuracy by which trial grasps may differ."""
    return ACCEPTED_WITH_SPREAD if config.spread else ACCEPTED


def _culprit(problem: Problem, grip: Grip, trial: TrialGrasps) -> str:
    """Return the kind of the term that makes the grasp depend on its steps; empty if no single term does."""
    scale = CONTROLLED[1]
    pair = [propose(problem, grip, s) for s in (scale, _reference_scale(problem.model_config, scale))]
    fine, finer = pair
    errors = {}
    for i, kind in enumerate(trial.setup.kinds):
        without = trial.with_setup(without_term(trial.setup, i))
        errors[kind] = deviation(*(without.record(steps) for steps in pair))[0]
    with_all, _ = deviation(trial.record(fine), trial.record(finer))
    term = min(errors, key=errors.__getitem__, default="")
    return term if term and errors[term] < CULPRIT * with_all else ""


def _refusal(problem: Problem, error: float, quantity: str, term: str) -> str:
    config = problem.model_config
    miss = f"{quantity} differs by {error:.2g}" if math.isfinite(error) else "even the outcome differs"
    cause = (
        f"the steps because of the term {term!r}" if term else "the steps, and not because of a single term"
    )
    reachable = 2.0 * error / _accepted_share(config)
    advice = f"ask for {reachable:.1g} (gripper.accuracy), or " if reachable <= 0.5 else ""
    return (
        f"{_scene_in_words(problem)}: no model of it reaches gripper.accuracy = {config.accuracy:g}: with every term "
        f"and the smallest steps, {miss} between two step lengths. The grasp depends on {cause}; {advice}accept an "
        'unverified result with gripper.fidelity = "reference"'
    )


def _scene_in_words(problem: Problem) -> str:
    spec: ObjectSpec | None = problem.spec
    return "the scene" if spec is None else spec.file or f"object {spec.name!r}"
