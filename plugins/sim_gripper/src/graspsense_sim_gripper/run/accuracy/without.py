"""What each feature of a grasp would lose if a term were left out of the scene.

The nominal object is grasped with ideal sensors under the controller of the run, with all terms and without each of
them in turn, in the same steps.
"""

from __future__ import annotations

import math
from typing import Any

from attrs import evolve

from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.verify import TooMuchWork, TrialGrasps, trial_grasps, without_term
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.problem import GraspController
from graspsense_sim_gripper.run.term_failure import TermFailed
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS


def without_each_term(
    problem: Problem, controller: GraspController, chosen: ChosenSteps
) -> list[dict[str, Any]]:
    """Return for each term of the object what its absence changes, as plain values.

    `term` is its kind, `same_outcome` whether the grasp ends in the same way, and `changes` gives for each feature its
    value, that without the term, and the change: relative to the value, or to the scale of its unit where that is
    larger (`error.UNIT_SCALES`). The peak force counts as a feature. A value that a grasp does not have is None, as is
    the change then; a feature that neither grasp has is left out. `failed` says why there is no grasp without the term,
    and is empty if there is one. Raises TypeError if there is no object.
    """
    trial = trial_grasps(problem, controller, compiled=False, padding=None)
    expected = trial.record(chosen)
    rows = []
    for i, kind in enumerate(trial.setup.kinds):
        other = evolve(trial, setup=without_term(trial.setup, i))
        row: dict[str, Any] = {"term": kind, "same_outcome": False, "changes": {}, "failed": ""}
        try:
            row["same_outcome"] = other.record(chosen).outcome == expected.outcome
            row["changes"] = _changes(trial, other, chosen)
        except (TermFailed, *LAW_ERRORS) as error:
            row["failed"] = str(error)
        except TooMuchWork:
            row["failed"] = "the grasp without it takes too many ticks and steps"
        rows.append(row)
    return rows


def _changes(
    trial: TrialGrasps, other: TrialGrasps, chosen: ChosenSteps
) -> dict[str, dict[str, float | None]]:
    """Return what `without_each_term` has under `changes`."""
    without = other.values(chosen)
    changes: dict[str, dict[str, float | None]] = {}
    for name, (value, scale) in trial.values(chosen).items():
        other_value = without[name][0] if name in without else math.nan
        if math.isnan(value) and math.isnan(other_value):
            continue
        known = math.isfinite(value - other_value)
        largest = max(abs(value), scale)
        changes[name] = {
            "value": None if math.isnan(value) else value,
            "without": None if math.isnan(other_value) else other_value,
            "change": (other_value - value) / largest if known and largest > 0.0 else None,
        }
    return changes
