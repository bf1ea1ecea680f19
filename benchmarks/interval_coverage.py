"""Coverage of the 95 % intervals of recognition rates and their differences: how often they contain the true one.

    python benchmarks/interval_coverage.py [--repeats 2000] [--short]

The first table draws the rate of each instance from a beta distribution and its trials from that rate. `correlation` is
that of two trials of the same instance. It compares the interval that graspsense prints (`graspsense`) with Wilson's of
independent trials. The second table cross-validates c45 on features with differences between instances, with whole
instances held out, and on as many independent trials; `difference` is that to knn on the same folds. What is true is
the mean of all repeats.
"""

from __future__ import annotations

import numpy as np
from arguments import parser_of

from graspsense.core.components.registry import installed
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.crossval import cross_validate
from graspsense.evaluation.folds import held_out
from graspsense.evaluation.intervals import Interval, clustered, difference, rate_of, wilson
from graspsense.experiments.versions import where_measured

TRIALS = 8
"""Trials of each instance."""
INSTANCES = (4, 6, 8, 12, 24, 48)
FOLDS = 10


def intervals(counts: np.ndarray) -> dict[str, Interval]:
    """Return the intervals of a rate from the number of correct trials of each instance."""
    k = len(counts)
    n, correct = TRIALS * k, int(counts.sum())
    right = [j < count for count in counts for j in range(TRIALS)]
    names = [str(i) for i in range(k) for _ in range(TRIALS)]
    return {"wilson": wilson(correct, n), "graspsense": clustered(right, names)}


def coverage(k: int, rate: float, correlation: float, repeats: int, seed: int = 0) -> dict[str, float]:
    """Return the coverage of each interval with `k` instances, and the mean width of ours."""
    rng = np.random.default_rng([seed, k, round(1000 * rate), round(1000 * correlation)])
    size = (1.0 - correlation) / correlation
    covered: dict[str, int] = {}
    width = 0.0
    for _ in range(repeats):
        counts = rng.binomial(TRIALS, rng.beta(rate * size, (1.0 - rate) * size, k))
        for name, (low, high) in intervals(counts).items():
            covered[name] = covered.get(name, 0) + (low <= rate <= high)
            if name == "graspsense":
                width += high - low
    return {**{name: count / repeats for name, count in covered.items()}, "width": width / repeats}


def evaluated(k: int, repeats: int, *, objects: bool = True) -> dict[str, float]:
    """Return the coverage for a cross-validation on `k` instances, half of them full, or on as many single trials."""
    learners = [
        SelectedComponent(component, component.config_class()())
        for component in (installed().find("classifier", name) for name in ("c45", "knn"))
    ]
    rates, differences = [], []
    for seed in range(repeats):
        rng = np.random.default_rng([1, k, seed])
        instance = np.repeat(np.arange(k), TRIALS)
        full = instance % 2
        shift = rng.normal(size=(k, 2))[instance if objects else rng.permutation(instance)]
        values = 3.0 * np.outer(full, [1.0, 0.6]) + shift + 0.5 * rng.normal(size=(k * TRIALS, 2))
        table = FeatureTable(names=("a", "b"), units=("", ""), values=values)
        labels = ["full" if is_full else "empty" for is_full in full]
        names = [f"bottle#{i}" for i in instance] if objects else None
        folds = held_out(labels, names, FOLDS, seed)
        ours, other = (
            cross_validate(learner, table, labels, folds, seed=seed).right(labels) for learner in learners
        )
        rates.append(rate_of(ours, names, folds=FOLDS))
        differences.append(difference(ours, other, names, folds=FOLDS))
    rate = float(np.mean([measured.rate for measured in rates]))
    less = float(np.mean([measured.value for measured in differences]))
    return {
        "rate": rate,
        "wilson": _covered(rate, [wilson(measured.correct, measured.n) for measured in rates]),
        "graspsense": _covered(rate, [measured.interval for measured in rates]),
        "difference": less,
        "of difference": _covered(less, [measured.interval for measured in differences]),
    }


def _covered(true: float, measured: list[Interval | None]) -> float:
    return float(
        np.mean([interval is not None and interval[0] <= true <= interval[1] for interval in measured])
    )


def main() -> None:
    """Print both tables."""
    parser = parser_of(__doc__)
    parser.add_argument("--repeats", type=int, default=2000)
    given = parser.parse_args()
    repeats = 2 if given.short else given.repeats
    print(f"{where_measured()}, {repeats} repeats\n")
    print("| instances | rate | correlation | Wilson | graspsense | mean width |\n|---|---|---|---|---|---|")
    for k in INSTANCES:
        for rate in (0.6, 0.85, 0.95):
            for correlation in (0.02, 0.1, 0.3):
                shares = coverage(k, rate, correlation, repeats)
                cells = [f"{shares[name]:.3f}" for name in ("wilson", "graspsense", "width")]
                print(f"| {k} | {rate} | {correlation} | {' | '.join(cells)} |", flush=True)
    print(
        "\n| trials | true rate | Wilson | graspsense | difference | its coverage |\n|---|---|---|---|---|---|"
    )
    for k, objects in ((6, True), (12, True), (24, True), (6, False), (24, False)):
        shares = evaluated(k, repeats if given.short else max(repeats // 4, 20), objects=objects)
        trials = f"{TRIALS} of each of {k}" if objects else f"{TRIALS * k}"
        print(f"| {trials} | {' | '.join(f'{share:.3f}' for share in shares.values())} |", flush=True)


if __name__ == "__main__":
    main()
