"""What the accuracy of a simulator does to recognition, with the sensors of the gripper.

A classifier learns the grasps of each variant, and is tested on the same other grasps of the reference.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from attrs import evolve

from graspsense.core.components.roles import BatchBackend, SimulationVariant
from graspsense.evaluation.intervals import difference, rate_among
from graspsense.experiments.recognise import TEST_SEED_OFFSET, true_and_predicted
from graspsense.sources.simulated import Group, simulated

if TYPE_CHECKING:
    from graspsense.core.learn.labelled import Labelled
    from graspsense.core.settings.resolved import Settings
    from graspsense.experiments.simulation import SimulationTrade, VariantPoint

HARDLY: Final = 2.0
"""Ratio of two times below which a user hardly feels the difference."""


def with_recognition(
    trade: SimulationTrade,
    settings: Settings,
    *,
    instances: int,
    progress: Callable[[str, int, int], None] | None = None,
) -> SimulationTrade:
    """Return the trade-off with the recognition of the reference and of the variants that are `for_recognition`.

    `instances`: individuals of each object in each state, for training and as many for the test; each is grasped once.

    Without such variants, or in a pipeline without a classifier, nothing is added.
    """
    learner, backend = settings.classifier, settings.gripper.create()
    assert isinstance(backend, BatchBackend)
    chosen = [variant for variant in backend.variants() if variant.for_recognition]
    if learner is None or not chosen:
        return trade
    (reference,) = (variant for variant in backend.variants() if variant.role == "reference")
    seed = settings.run.seed

    def grasped(variant: SimulationVariant, seed: int) -> Labelled:
        gripper = evolve(settings.gripper, config=evolve(settings.gripper.config, **variant.settings))
        group = Group(instances=instances, trials=1)
        return simulated(evolve(settings, gripper=gripper), groups=(group,), seed=seed)

    test = grasped(reference, seed + TEST_SEED_OFFSET)
    right = {}
    for k, variant in enumerate((reference, *chosen)):
        if progress is not None:
            progress(f"recognition, {variant.method}, {variant.step}", k, 1 + len(chosen))
        true, predicted = true_and_predicted(learner, grasped(variant, seed), test, "both", seed)
        right[variant.method, variant.step] = [
            label == answer for label, answer in zip(true, predicted, strict=True)
        ]
    expected = right[reference.method, reference.step]

    def recognised(point: VariantPoint) -> VariantPoint:
        answers = right.get((point.method, point.step))
        if answers is None:
            return point
        behind = difference(expected, answers, test.instances, comparisons=len(chosen))
        return evolve(
            point,
            recognised=rate_among(test, answers),
            behind=None if point.role == "reference" else behind,
        )

    return evolve(trade, points=tuple(map(recognised, trade.points)))


def conclusion(trade: SimulationTrade) -> str:
    """Return in words what a lower accuracy saves, what it does to recognition, and where recognition has a price.

    It is empty where no recognition was compared.
    """
    compared = [point for point in trade.points if point.behind is not None]
    if not compared:
        return ""
    times_ms = [1e3 * point.seconds for point in compared]
    shown = [point.step for point in compared if point.behind and point.behind.excludes_zero]
    rates = f"a difference of recognition from the reference is shown at {', '.join(shown)}"
    if not shown:
        rates = "no difference of recognition from the reference is shown"
        if max(times_ms) < HARDLY * min(times_ms):
            rates += ": inside the simulator there is hardly a trade-off"
    return (
        f"Between the accuracies {compared[0].step} and {compared[-1].step}, a grasp takes {min(times_ms):.3g} to "
        f"{max(times_ms):.3g} ms, and {rates}. Recognition has a price in the seconds, newtons and squeezes of a "
        "grasp, and in its sensors: graspsense tradeoff time, force, squeezes, sensing."
    )
