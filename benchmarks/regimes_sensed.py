"""Whether pads and spread give the distributions of the reference, on scenes of the map of regimes. Simulated.

    python benchmarks/regimes_sensed.py [--scenes 500] [--instances 640] [--rows FILE] [--first N] [--short]

Each scene of `benchmarks/regimes.py` with a stable loop is read by pads and encoder, with a spread of 10 % of
stiffness, 0.5 mm of width and offset, and of Coulomb friction. Its instances are grasped in the model that is selected
for 1 %, and with every term in steps for 0.01 %, with the same seeds; the six features are those that `chitta` extracts
from what the pads show. Where the steps for 0.01 % are not verified, refused or flagged in an instance, the
reference is used. It takes some hundred times as long or more, so it is not used everywhere, and for a quarter of
the instances only.

The distance of two distributions of a feature is the Wasserstein distance, relative to the root mean square of the
feature in the reference, or to the scale of the unit if that is larger (`accuracy.error.UNIT_SCALES` of the
simulator). It is within the accuracy if it is smaller, and shown to be if the upper end of its one-sided 95 % interval
is (bootstrap over instances). Where it is larger, a permutation test (the model and the reference swapped at random in
each instance) says whether the distributions differ at all, or the distance is that of so many instances. A feature is
compared where both grasps of an instance have it; the shares of instances that have it are compared as well. A scene
with a distribution beyond the accuracy is measured again, with four times as many other instances, and that is its
result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve
from numpy.typing import NDArray
from random_scenes import KINDS, Bench, Scene, controller_is_stable
from regimes import options, run, scene_of, share_words
from scipy.stats import binomtest

from graspsense.experiments.versions import where_measured
from graspsense.gripper_api import Outcome
from graspsense.plugin_api import ConfigError, Features, create
from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.run.accuracy.error import UNIT_SCALES
from graspsense_sim_gripper.run.batch.job import Job
from graspsense_sim_gripper.run.build import Problem, instantiate
from graspsense_sim_gripper.run.model_report import accuracy_report, model_report
from graspsense_sim_gripper.run.problem import GraspController

Row = dict[str, Any]
ACCURACY: Final = 0.01
REFERENCE_SHARE: Final = 4
AGAIN: Final = 4
"""Multiple of the instances with which a scene beyond the accuracy is measured again."""
FINEST: Final = ({"accuracy": 1e-4, "fidelity": "scene"}, {"accuracy": ACCURACY, "fidelity": "reference"})
"""The settings of what the models are compared with, the first that is verified."""
RESAMPLES: Final = 400
LEAST_PAIRS: Final = 5
DIFFERS: Final = 0.05
"""Probability below which two distributions are taken as different."""


def sensed(scene: Scene) -> Scene:
    """Return the scene with pads and a spread of its instances."""
    spec = evolve(scene.spec, stiffness_spread=0.1, width_spread_m=5e-4, offset_spread_m=5e-4)
    config = evolve(scene.config, sensor="pads", spread=True, coulomb_spread_n=0.1 * scene.config.coulomb_n)
    return evolve(scene, spec=spec, config=config)


class Grasps:
    """The instances of a scene, grasped in one model."""

    def __init__(self, bench: Bench, scene: Scene, settings: Row) -> None:
        features = create("feature-set", "chitta")
        controller = create("controller", "hybrid", closing_speed_m_s=scene.speed_m_s)
        config, run = evolve(scene.config, **settings), RunConfig(grasp_timeout_s=20.0)
        self.bench, self.problem = bench, Problem(config, scene.spec)
        self.chosen = bench.selected(self.problem, GraspController(controller, run, features))
        self.job = Job(config=config, controller=controller, run=run, extract=features.extract, traces=False)
        self.features: list[Features] = []
        self.outcomes: list[Outcome] = []
        self.doubts: set[str] = set()
        """The quantities that a report of some instance names as not verified."""

    def extend(self, instances: int) -> None:
        """Grasp further instances until there are so many."""
        for seed in range(len(self.features), instances):
            setup = instantiate(self.problem, self.chosen, seed)
            done = self.bench.run(self.job, setup)
            self.features.append(done.extracted)
            self.outcomes.append(done.outcome)
            report = model_report(done.state, KINDS if self.bench.compiled else setup.kinds)
            self.doubts.update(accuracy_report(report, self.chosen, "")["not_verified"])


class Distance(NamedTuple):
    """The distance of the distributions of a feature in a model and in the reference."""

    relative: float
    """To the root mean square of the feature."""
    at_most: float
    """The upper end of its one-sided 95 % interval."""
    missing: float
    """The difference of the shares of instances that have the feature."""
    p: float
    """How probable a distance as large is if the distributions are equal."""

    @property
    def largest(self) -> float:
        """The larger of the distance and the difference of the shares."""
        return max(self.relative, self.missing)


def wasserstein(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distances of samples of equal size, along the last axis."""
    return np.asarray(np.mean(np.abs(np.sort(ours, axis=-1) - np.sort(theirs, axis=-1)), axis=-1))


def distance(ours: NDArray[np.float64], theirs: NDArray[np.float64], unit: str) -> tuple[float, float, float]:
    """Return the distance of two paired samples, the upper end of its interval, and p if they are equal."""
    scale = max(float(np.sqrt(np.mean(theirs**2))), UNIT_SCALES[unit])
    rng, relative = np.random.default_rng(0), float(wasserstein(ours, theirs)) / scale
    drawn = rng.integers(len(ours), size=(RESAMPLES, len(ours)))
    # The basic bootstrap interval: resampling adds to a distance what it is above the found one.
    spread = np.quantile(wasserstein(ours[drawn], theirs[drawn]) / scale, 0.95) - relative
    swap = rng.random((RESAMPLES, len(ours))) < 0.5
    swapped = wasserstein(np.where(swap, theirs, ours), np.where(swap, ours, theirs)) / scale
    p = (1.0 + float(np.sum(swapped >= relative))) / (1.0 + RESAMPLES)
    return relative, relative + max(float(spread), 0.0), p


def compared(ours: Sequence[Features], theirs: Sequence[Features]) -> dict[str, Distance]:
    """Return the distance of each feature."""
    values, expected = (np.array([features.values for features in some]) for some in (ours, theirs))
    result = {}
    for k, (name, unit) in enumerate(zip(theirs[0].names, theirs[0].units, strict=True)):
        has = [~np.isnan(feature_values[:, k]) for feature_values in (values, expected)]
        both = has[0] & has[1]
        if np.sum(both) < LEAST_PAIRS:
            relative, at_most, p = 0.0, 0.0, 1.0
        else:
            relative, at_most, p = distance(values[both, k], expected[both, k], unit)
        gone, come = int(np.sum(has[0] & ~has[1])), int(np.sum(has[1] & ~has[0]))
        if gone != come:
            # A sign test of the instances that have the feature in one of the two only.
            p = min(p, float(binomtest(gone, gone + come).pvalue))
        result[name] = Distance(relative, at_most, abs(gone - come) / len(ours), p)
    return result


def finest(bench: Bench, scene: Scene) -> Grasps:
    """Return the grasps that a model is compared with. Raises ConfigError if the reference is refused."""
    fast, reference = FINEST
    with suppress(ConfigError):
        grasps = Grasps(bench, scene, fast)
        if not grasps.chosen.not_verified:
            return grasps
    return Grasps(bench, scene, reference)


def measured(bench: Bench, number: int, instances: int) -> Row:
    """Return the distances of a scene, from so many instances."""
    scene, row = sensed(scene_of(number)), {}
    try:
        best = finest(bench, scene)
        row["by"] = best.job.config.fidelity
        if not controller_is_stable(instantiate(best.problem, best.chosen, 0), best.chosen):
            return {**row, "unstable": True}
        if row["by"] != "reference":
            best.extend(instances)
            if best.doubts:
                best = Grasps(bench, scene, FINEST[-1])
                row["by"] = best.job.config.fidelity
        if row["by"] == "reference":
            instances = max(instances // REFERENCE_SHARE, LEAST_PAIRS)
            best.extend(instances)
    except (ArithmeticError, ConfigError) as error:
        return {**row, "failed": f"the reference: {error}"[:200]}
    try:
        grasps = Grasps(bench, scene, {"accuracy": ACCURACY})
        row["selected"] = compared = against(best, grasps, 0, instances)
        if largest(compared) > ACCURACY and not compared["doubts"]:
            fresh = against(best, grasps, instances, (1 + AGAIN) * instances)
            row["selected"] = {**fresh, "before": largest(compared)}
    except (ArithmeticError, ConfigError) as error:
        row["selected"] = {"refused": f"{type(error).__name__}: {error}"[:200]}
    return row


def against(best: Grasps, grasps: Grasps, begin: int, end: int) -> Row:
    """Return the distances of these instances of a model from those of the best one."""
    for model in (best, grasps):
        model.extend(end)
    pairs = zip(grasps.outcomes[begin:end], best.outcomes[begin:end], strict=True)
    return {
        "features": compared(grasps.features[begin:end], best.features[begin:end]),
        "outcomes": sum(outcome != other for outcome, other in pairs) / (end - begin),
        "doubts": sorted(grasps.doubts),
    }


def largest(row: Row) -> float:
    """Return the largest distance of a feature, or difference of the shares that have it."""
    return max(Distance(*numbers).largest for numbers in row["features"].values())


def differs(row: Row) -> bool:
    """Return whether a feature is beyond the accuracy, and its distribution is not that of the reference by chance.

    The tests of the features together have the probability `DIFFERS` of an error (Bonferroni).
    """
    some = [Distance(*numbers) for numbers in row["features"].values()]
    return any(
        feature_distance.largest > ACCURACY and feature_distance.p < DIFFERS / len(some)
        for feature_distance in some
    )


def page(rows: Sequence[Row], instances: int) -> list[str]:
    """Return the figures in Markdown."""
    done = [row for row in rows if "failed" not in row and not row.get("unstable")]
    lines = [
        f"{len(done)} scenes of {instances} instances each (numbers {rows[0]['scene']} to {rows[-1]['scene']}; "
        f"{sum(row['by'] == 'reference' for row in done)} compared with the reference, "
        f"with 1/{REFERENCE_SHARE} of the instances; "
        f"{sum('before' in row['selected'] for row in done)} measured again with {AGAIN} times as many; "
        f"{sum(bool(row.get('unstable')) for row in rows)} others have an unstable loop, "
        f"{sum('failed' in row for row in rows)} no reference); {where_measured()}.",
        "",
        "| model | all features within 1 % | within 1 %, flagged or refused | shown within 1 % "
        "| within 1 %, not shown to differ, flagged or refused | flagged | refused "
        "| largest distance without a flag |",
        "|---|---|---|---|---|---|---|---|",
    ]
    cases = [row["selected"] for row in done]
    known = [case for case in cases if "refused" not in case]
    worst = [(largest(case), case) for case in known]
    upper = [max(max(u, gone) for _, u, gone, _ in case["features"].values()) for case in known]
    different = sum(differs(case) and not case["doubts"] for case in known)
    within = sum(d <= ACCURACY for d, _ in worst)
    told = sum(d <= ACCURACY or bool(case["doubts"]) for d, case in worst) + len(cases) - len(known)
    silent = max((d for d, case in worst if not case["doubts"]), default=math.nan)
    lines += [
        f"| selected for 1 % | {share_words(within, len(cases))} | {share_words(told, len(cases))} "
        f"| {share_words(sum(u <= ACCURACY for u in upper), len(cases))} "
        f"| {share_words(len(cases) - different, len(cases))} "
        f"| {sum(bool(case['doubts']) for case in known)} | {len(cases) - len(known)} | {silent:.2g} |",
        "",
        "| feature | median distance |",
        "|---|---|",
    ]
    for name in known[0]["features"] if known else ():
        distances = [case["features"][name][0] for case in known]
        lines.append(f"| `{name}` | {np.median(distances):.1e} |")
    return lines


def main() -> None:
    parser = options(__doc__, 500)
    parser.add_argument("--instances", type=int, default=640)
    given = parser.parse_args()
    if given.short:
        given.scenes, given.instances, given.first = 1, 5, 1
    bench = Bench(compiled=not given.short)
    rows = run(lambda number: measured(bench, number, given.instances), given.rows, given.scenes, given.first)
    print("\n".join(page(rows, given.instances)))


if __name__ == "__main__":
    main()
