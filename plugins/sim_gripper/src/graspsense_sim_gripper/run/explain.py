"""What each term of the object contributes to a grasp, and what each feature would lose without it.

For the first, the law of the term is evaluated again along the recorded compressions. For the second, the nominal
object is grasped with ideal sensors under the controller of the run, with all terms and without each of them in turn,
in the same steps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from attrs import evolve

from graspsense_sim_gripper.plant.pads import pad_compression
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.verify import TooMuchWork, TrialGrasps, trial_grasps, without_term
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.problem import GraspController, GraspSetup
from graspsense_sim_gripper.run.term_failure import TermFailed
from graspsense_sim_gripper.scene.spec import TermParams
from graspsense_sim_gripper.scene.terms.registry import find_term
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS, WorkingPoint


def explain(setup: GraspSetup, compressions: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Return the contribution of each term as plain values.

    `compressions` holds the compression (m) and the force (N) of the object at each tick from the first contact on.
    Ticks in which the fingers do not press the object are left out: what its terms do to each other while it recovers
    is faster than a tick. For each term, `terms` gives

    - `peak_n`: its largest force (N),
    - `at_peak_n` and `share`: its force (N) when the force of the object is largest, and its share of the sum of terms,
    - `work_j`: the work done on it until then (J),
    - `lost_j`: the work that it has not returned when the object separates (J),
    - `rates`: its rates (1/s).
    """
    if not compressions:
        return {"touched": False, "terms": []}
    path = [0.0, *(compression_m for compression_m, _ in compressions)]
    forces_n = [force_n for _, force_n in compressions]
    peak = max(range(len(forces_n)), key=forces_n.__getitem__)
    deepest = max(path)
    point = WorkingPoint(
        compression_m=deepest,
        speed_m_s=deepest / (max(path.index(deepest), 1) * setup.dt_s),
        seconds=len(forces_n) * setup.dt_s,
    )
    along = _Path(path, [force_n > 0.0 for force_n in forces_n], peak, setup.dt_s)
    rows = [
        _contribution(kind, params, along, point)
        for kind, params in zip(setup.kinds, setup.terms, strict=True)
    ]
    total = sum(row["at_peak_n"] for row in rows)
    for row in rows:
        row["share"] = row["at_peak_n"] / total if total != 0.0 else 0.0
    return {
        "touched": True,
        "peak_n": forces_n[peak],
        "compression_m": deepest,
        "pads_m": pad_compression(setup.plant.object.pads, forces_n[peak]),
        "speed_m_s": point.speed_m_s,
        "seconds": point.seconds,
        "terms": rows,
    }


class _Path(NamedTuple):
    """The compression of the object in the ticks of a grasp."""

    compression_m: Sequence[float]
    """Before the first tick and after each tick."""
    pressed: Sequence[bool]
    """Whether the fingers press the object at the end of each tick."""
    peak: int
    """The tick of the largest force."""
    dt_s: float


def _contribution(kind: str, params: TermParams, along: _Path, point: WorkingPoint) -> dict[str, Any]:
    """Return the contribution of a term."""
    term, (path, pressed, peak, dt_s) = find_term(kind)[1], along
    state, force, work, work_to_peak = term.at_rest, 0.0, 0.0, 0.0
    forces: list[float] = []
    for i in range(len(path) - 1):
        last_force = force
        # The mean rate over this tick and the next, if the object is still pressed in it.
        ticks = 2 if i + 2 < len(path) and pressed[i + 1] else 1
        speed = (path[i + ticks] - path[i]) / (ticks * dt_s)
        force, state = term.law(params, state, path[i], path[i + 1], dt_s, speed)
        if not pressed[i]:
            force = 0.0
        else:
            work += 0.5 * (last_force + force) * (path[i + 1] - path[i])
        forces.append(force)
        if i == peak:
            work_to_peak = work
    return {
        "term": kind,
        "peak_n": max(forces, key=abs),
        "at_peak_n": forces[peak],
        "work_j": work_to_peak,
        "lost_j": work,
        "rates": [rate._asdict() for rate in (term.rates(params, point) if term.rates else ())],
    }


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
