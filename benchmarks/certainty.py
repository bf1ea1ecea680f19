"""Whether what a model prints of its answers holds, on simulated grasps that it never saw.

    python benchmarks/certainty.py [PIPELINE] [--seed 7001] [--instances 67]

For each class of support and tenth of the printed certainty, and for each answer: the mean certainty, and the rate of
right answers with its 95 % interval. For the prediction sets: how often they hold the true label among answers from few
training trials and from many, among sets of one label, and for each label. The command fails with 1 if a certainty lies
above its interval, or a coverage below what is asked for, by more than chance allows: 5 % over all rows (Bonferroni).
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from arguments import parser_of
from scipy.special import ndtri

from graspsense.core.components.registry import installed
from graspsense.core.pipeline.pipeline import model_for
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.features import UNKNOWN
from graspsense.evaluation.intervals import percent, percentages, wilson
from graspsense.sources.trial_source import load_trials

if TYPE_CHECKING:
    from numpy.typing import NDArray

SMALL: Final = 10
"""An answer from fewer training trials than this rests on few."""


def main() -> int:
    """Grasp, predict, and print the tables."""
    parser = parser_of(__doc__)
    parser.add_argument("pipeline", nargs="?", default="default")
    parser.add_argument("--seed", type=int, default=7001)
    parser.add_argument("--instances", type=int, default=67)
    asked = parser.parse_args()
    if asked.short:
        asked.instances = 2
    model = model_for(resolve(asked.pipeline), installed())
    assert model is not None
    trials = load_trials(pipeline=asked.pipeline, seed=asked.seed, instances=asked.instances, trials=1)
    predictions = model.predictions(trials.table, trials.provenance)
    support = model.classifier.support(trials.table.columns(model.names))
    rests_on = np.full(len(trials), np.nan) if support is None else support
    called = np.array([prediction.label for prediction in predictions])
    known, right = called != UNKNOWN, called == np.array(trials.labels)
    certainty = np.array(
        [np.nan if prediction.certainty is None else prediction.certainty for prediction in predictions]
    )
    inside = np.array(
        [
            label in prediction.prediction_set
            for prediction, label in zip(predictions, trials.labels, strict=True)
        ]
    )
    sizes = np.array([len(prediction.prediction_set) for prediction in predictions])
    print(f"{model.in_a_line}\n{len(trials)} new grasps, seed {asked.seed}: {percent(right.mean())} right")
    classes = {"all": known} if support is None else dict(_classes(rests_on, known))
    rows = [
        (f"{name}, {10 * tenth} to {10 * tenth + 10} %", right[in_tenth], float(certainty[in_tenth].mean()))
        for name, among in classes.items()
        for tenth in range(10)
        if (in_tenth := among & (np.minimum(np.floor(10.0 * certainty), 9) == tenth)).any()
    ]
    of_label = {name: ~np.isnan(certainty) & (called == name) for name in trials.classes}
    rows += [
        (name, right[group], float(certainty[group].mean()))
        for name, group in of_label.items()
        if group.any()
    ]
    groups = {**classes, "sets of one label": sizes == 1}
    groups |= {label: known & (np.array(trials.labels) == label) for label in trials.classes}
    with_set = {name: group & (sizes > 0) for name, group in groups.items()}
    covered = [(name, inside[group]) for name, group in with_set.items() if group.any()]
    asked_for = model.sets.coverage if model.sets is not None else 0.0
    wrong = _certainties(rows, len(rows) + len(covered))
    print(
        f"\nlabels in a set: {sizes[known].mean():.2f}; sets of one label: {percent((sizes[known] == 1).mean())}"
    )
    wrong += _coverages(covered, asked_for, len(rows) + len(covered))
    return 1 if wrong else 0


def _classes(
    support: NDArray[np.float64], known: NDArray[np.bool_]
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    few = np.nan_to_num(support, nan=0.0) < SMALL
    yield f"under {SMALL} trials", known & few
    yield f"{SMALL} trials and more", known & ~few


def _certainties(rows: list[tuple[str, Any, float]], comparisons: int) -> int:
    """Print the rows, and return how many certainties lie above the interval for this number of comparisons."""
    print(f"\n{'rests on, certainty':<34} {'n':>5} {'said':>7} {'right':>7}  95 %")
    wrong = 0
    for name, right, said in rows:
        _, high = wilson(float(right.sum()), len(right), float(ndtri(1.0 - 0.025 / comparisons)))
        verdict = "" if said <= high else "  too sure"
        wrong += bool(verdict)
        interval = percentages(wilson(float(right.sum()), len(right)))
        print(
            f"{name:<34} {len(right):>5} {percent(said):>7} {percent(right.mean()):>7}  {interval}{verdict}"
        )
    return wrong


def _coverages(rows: list[tuple[str, Any]], asked: float, comparisons: int) -> int:
    """Print the rows, and return how many lie below what is asked for by more than chance allows."""
    print(f"\n{'sets of ' + percent(asked):<34} {'n':>5} {'covered':>7}  95 %")
    wrong = 0
    for name, inside in rows:
        _, high = wilson(float(inside.sum()), len(inside), float(ndtri(1.0 - 0.05 / comparisons)))
        verdict = "" if high >= asked else "  too few"
        wrong += bool(verdict)
        interval = percentages(wilson(float(inside.sum()), len(inside)))
        print(f"{name:<34} {len(inside):>5} {percent(inside.mean()):>7}  {interval}{verdict}")
    return wrong


if __name__ == "__main__":
    sys.exit(main())
