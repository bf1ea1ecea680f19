"""What a user gets from a simulator's variants with its real sensors: distributions of features, recognition, time.

Every variant grasps the same objects with the same seeds as the reference. Two figures follow for each variant:

- the distance of each feature's distribution from that in the reference, over all seeds
  (`graspsense.evaluation.distribution`),
- the recognition rate of a classifier that is trained on the variant's grasps and tested on other grasps of the
  reference, and whether it is equivalent to that of a classifier trained on the reference
  (`graspsense.evaluation.over_seeds`).
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from operator import eq
from typing import Any, Final

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense.core.components.caller import set_option
from graspsense.core.components.roles import BatchBackend, SimulationVariant
from graspsense.core.settings.resolved import Settings
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import FeatureTable, table_of
from graspsense.evaluation.distribution import DistributionDistance, distribution_distance
from graspsense.evaluation.over_seeds import Equivalence, equivalence
from graspsense.experiments.recognise import TEST_SEED_OFFSET, predictions
from graspsense.experiments.sensors import sensors_of
from graspsense.report.simulation import MeasuredVariant
from graspsense.sources.simulated import Group, SimulationPlan, plan_trials

TIME_MARGIN: Final = 1.25
"""Ratio of two times up to which no difference is concluded: batches of the same variant differ by as much."""
LIMIT: Final = 0.1
"""Distance of distributions, in standard deviations, below which a variant of no stated accuracy is equivalent."""


@frozen(kw_only=True, slots=False)
class SensedPoint(MeasuredVariant):
    """What a variant costs and how near it is to the reference."""

    distances: tuple[DistributionDistance, ...]
    """One for each feature."""
    rates: tuple[float, ...]
    """The recognition rate of each seed."""
    equivalence: Equivalence | None
    """None for the reference, and with fewer than two seeds."""

    @property
    def largest(self) -> DistributionDistance:
        """The distance of the feature that is furthest away, by the upper end of its interval."""
        return max(self.distances, key=lambda distance: distance.upper)


@frozen(kw_only=True)
class SensedTrade:
    """All variants, from the fastest to the slowest."""

    objects: tuple[str, ...]
    sensor: str
    classifier: str
    grasps: int
    """Grasps of a seed, for training and for testing each."""
    seeds: tuple[int, ...]
    points: tuple[SensedPoint, ...]

    @property
    def coarsest(self) -> SensedPoint | None:
        """The variant to take: among the fastest that are equivalent to the reference, the nearest to it."""
        equal = [
            point
            for point in self.points
            if point.equivalence is not None and point.equivalence.is_equivalent
        ]
        if not equal:
            return None
        fastest = min(point.seconds for point in equal)
        # Times that differ by less are not told apart, and of those the nearest to the reference is taken.
        return min(
            (point for point in equal if point.seconds <= TIME_MARGIN * fastest),
            key=lambda point: point.largest.upper,
        )


@frozen
class _Collected:
    """The features of all grasps of a variant, its rate with each seed, and the processor time of a grasp."""

    values: NDArray[np.float64]
    rates: Sequence[float]
    seconds: float


def sensed_trade(
    settings: Settings,
    *,
    objects: Sequence[str] = (),
    instances: int = 8,
    seeds: Sequence[int] = (1, 2),
    variants: Sequence[SimulationVariant] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> SensedTrade:
    """Measure each variant (by default those of the gripper that are `for_recognition`), with the settings' sensors.

    A seed has one grasp of each of `instances` individuals of each object in each state, and as many for testing.
    Raises ConfigError if the gripper cannot trade accuracy for time or the pipeline has no classifier.
    """
    backend = settings.gripper.create()
    if variants is None and isinstance(backend, BatchBackend):
        variants = [variant for variant in backend.variants() if variant.for_recognition]
    if not variants:
        raise ConfigError(f"gripper {settings.gripper.component.qualified} has no accuracy to trade for time")
    if settings.classifier is None:
        raise ConfigError(
            f"recognition needs a classifier: choose one, as in {set_option('classifier.type=c45')}"
        )
    in_turn = sorted(variants, key=lambda variant: variant.role != "reference")
    group = Group(objects=tuple(objects), instances=instances, trials=1)
    training = _Plans([plan_trials(settings, (group,), seed) for seed in seeds])
    tests = _Plans([plan_trials(settings, (group,), seed + TEST_SEED_OFFSET) for seed in seeds])
    names: tuple[str, ...] = ()
    test: FeatureTable | None = None
    collected: list[_Collected] = []
    for k, variant in enumerate(in_turn):
        tick = None if progress is None else partial(_tick, progress, variant, k, len(in_turn))
        if test is None:
            test = _grasps(settings, variant, tests, tick)[0]
        table, seconds = _grasps(settings, variant, training, tick)
        names = table.names
        rates = [
            _rate(settings.classifier, training.part(table, i), tests.part(test, i), seed)
            for i, seed in enumerate(seeds)
        ]
        collected.append(_Collected(table.values, rates, seconds))
    points = [
        _point(variant, grasps, collected[0], names, training.labels, comparisons=max(len(in_turn) - 1, 1))
        for variant, grasps in zip(in_turn, collected, strict=True)
    ]
    return SensedTrade(
        objects=training.plans[0].groups[0].objects,
        sensor=sensors_of(settings.gripper),
        classifier=settings.classifier.component.qualified,
        grasps=len(training.plans[0].labels),
        seeds=tuple(seeds),
        points=tuple(sorted(points, key=lambda point: point.seconds)),
    )


@frozen
class _Plans:
    """The grasps of several seeds, as many for each."""

    plans: Sequence[SimulationPlan]

    @property
    def labels(self) -> list[str]:
        return [label for plan in self.plans for label in plan.labels]

    def part(self, table: FeatureTable, i: int) -> tuple[FeatureTable, Sequence[str]]:
        """Return the features and labels of the seed with this number."""
        n = len(self.plans[0].labels)
        return table.rows(np.arange(i * n, (i + 1) * n)), self.plans[i].labels


def _tick(
    progress: Callable[[str, int, int], None],
    variant: SimulationVariant,
    k: int,
    of_all: int,
    done: int,
    total: int,
) -> None:
    progress(f"{variant.method}, {variant.fidelity}, {variant.step}: grasp {done} of {total}", k, of_all)


def _grasps(
    settings: Settings,
    variant: SimulationVariant,
    plans: _Plans,
    tick: Callable[[int, int], None] | None,
) -> tuple[FeatureTable, float]:
    """Return the features of all grasps of the plans, and the processor time of one."""
    backend = settings.gripper.component.create(evolve(settings.gripper.config, **variant.settings))
    controller = settings.controller.create()
    scenes = [scene for plan in plans.plans for scene in plan.scenes]
    seeds = [seed for plan in plans.plans for seed in plan.seeds]
    feature_set = settings.features.create()
    backend.expect_features(feature_set)
    options: dict[str, Any] = {
        "run": settings.run,
        "extract": feature_set.extract,
        "workers": 1,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # This compiles and selects the models, which a batch does once.
        backend.run_many(controller, plans.plans[0].scenes, plans.plans[0].seeds, **options)
        began = time.process_time()
        done = backend.run_many(controller, scenes, seeds, progress=tick, **options)
        spent = time.process_time() - began
    return table_of([grasp.extracted for grasp in done]), spent / len(scenes)


def _rate(
    learner: SelectedComponent,
    training: tuple[FeatureTable, Sequence[str]],
    test: tuple[FeatureTable, Sequence[str]],
    seed: int,
) -> float:
    """Return the share of test grasps that a classifier recognises which is trained on the other table."""
    predicted = predictions(learner, *training, test[0], seed)
    return float(np.mean(list(map(eq, predicted, test[1]))))


def _point(
    variant: SimulationVariant,
    measured: _Collected,
    reference: _Collected,
    names: Sequence[str],
    labels: Sequence[str],
    comparisons: int,
) -> SensedPoint:
    values, expected = measured.values, reference.values
    limit = float(variant.settings.get("accuracy", LIMIT)) if "step_s" not in variant.settings else LIMIT
    test = None
    if measured is not reference and len(measured.rates) > 1:
        trials = len(labels) // len(measured.rates)
        test = equivalence(measured.rates, reference.rates, trials, comparisons=comparisons)
    return SensedPoint.measured(
        variant,
        seconds=measured.seconds,
        distances=tuple(
            distribution_distance(name, values[:, k], expected[:, k], labels, limit)
            for k, name in enumerate(names)
        ),
        rates=tuple(measured.rates),
        equivalence=test,
    )
