"""Coverage of the 95 % intervals of recognition rates: how often they contain the true rate.

    python benchmarks/interval_coverage.py [--repeats 2000] [--short]

The first table draws the rate of each instance from a beta distribution and its trials from that rate. `correlation` is
that of two trials of the same instance. It compares the interval that graspsense prints (`graspsense`) with Wilson's of
independent trials, Student's t of the rates by instance, and the percentile bootstrap of instances. The second table
evaluates a classifier on features with differences between instances, with whole instances held out; the true rate is
the mean of all repeats.
"""

from __future__ import annotations

import math

import numpy as np
from arguments import parser_of
from scipy.special import stdtrit

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import Labelled
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.evaluate import evaluate
from graspsense.evaluation.intervals import Interval, clustered, wilson
from graspsense.experiments.versions import where_measured

TRIALS = 8
"""Trials of each instance."""
INSTANCES = (4, 6, 8, 12, 24, 48)
BOOTSTRAPS = 200


def intervals(counts: np.ndarray, rng: np.random.Generator) -> dict[str, Interval]:
    """Return the intervals of a rate from the number of correct trials of each instance."""
    k = len(counts)
    n, correct = TRIALS * k, int(counts.sum())
    rate = correct / n
    right = [j < count for count in counts for j in range(TRIALS)]
    names = [str(i) for i in range(k) for _ in range(TRIALS)]
    half = float(stdtrit(k - 1, 0.975)) * float(counts.std(ddof=1)) / TRIALS / math.sqrt(k)
    resampled = counts[rng.integers(0, k, (BOOTSTRAPS, k))].sum(axis=1) / n
    low, high = np.percentile(resampled, [2.5, 97.5]).tolist()
    return {
        "wilson": wilson(correct, n),
        "t": (rate - half, rate + half),
        "bootstrap": (low, high),
        "graspsense": clustered(right, names),
    }


def coverage(k: int, rate: float, correlation: float, repeats: int, seed: int = 0) -> dict[str, float]:
    """Return the coverage of each interval with `k` instances, and the mean width of ours."""
    rng = np.random.default_rng([seed, k, round(1000 * rate), round(1000 * correlation)])
    size = (1.0 - correlation) / correlation
    covered: dict[str, int] = {}
    width = 0.0
    for _ in range(repeats):
        counts = rng.binomial(TRIALS, rng.beta(rate * size, (1.0 - rate) * size, k))
        for name, (low, high) in intervals(counts, rng).items():
            covered[name] = covered.get(name, 0) + (low <= rate <= high)
            if name == "graspsense":
                width += high - low
    return {**{name: count / repeats for name, count in covered.items()}, "width": width / repeats}


def evaluated(k: int, repeats: int, classifier: str = "c45") -> dict[str, float]:
    """Return the coverage for a classifier that is cross-validated on `k` instances, half of them full."""
    component = installed().find("classifier", classifier)
    learner = SelectedComponent(component, component.config_class()())
    measured = []
    for seed in range(repeats):
        rng = np.random.default_rng([1, k, seed])
        instance = np.repeat(np.arange(k), TRIALS)
        full = instance % 2
        shift = rng.normal(size=(k, 2))[instance]
        noise = 0.5 * rng.normal(size=(k * TRIALS, 2))
        values = 3.0 * full[:, np.newaxis] * np.array([1.0, 0.6]) + shift + noise
        trials = Labelled(
            source="normal features",
            table=FeatureTable(names=("a", "b"), units=("", ""), values=values),
            labels=tuple("full" if is_full else "empty" for is_full in full),
            instances=tuple(f"bottle#{i}" for i in instance),
        )
        rate = evaluate(
            learner, trials, classifier=classifier, seed=seed, controls=False, learning_curve=False
        ).headline
        measured.append((rate.rate, wilson(rate.correct, rate.n), rate.interval or (0.0, 1.0)))
    true = float(np.mean([rate for rate, *_ in measured]))
    return {
        "rate": true,
        "wilson": float(np.mean([low <= true <= high for _, (low, high), _ in measured])),
        "graspsense": float(np.mean([low <= true <= high for *_, (low, high) in measured])),
    }


def main() -> None:
    """Print both tables."""
    parser = parser_of(__doc__)
    parser.add_argument("--repeats", type=int, default=2000)
    given = parser.parse_args()
    repeats = 2 if given.short else given.repeats
    print(f"{where_measured()}, {repeats} repeats\n")
    print("| instances | rate | correlation | Wilson | t | bootstrap | graspsense | mean width |")
    print("|---|---|---|---|---|---|---|---|")
    for k in INSTANCES:
        for rate in (0.6, 0.85, 0.95):
            for correlation in (0.02, 0.1, 0.3):
                shares = coverage(k, rate, correlation, repeats)
                cells = [
                    f"{shares[name]:.3f}" for name in ("wilson", "t", "bootstrap", "graspsense", "width")
                ]
                print(f"| {k} | {rate} | {correlation} | {' | '.join(cells)} |", flush=True)
    print("\n| instances | true rate | Wilson | graspsense |\n|---|---|---|---|")
    for k in (6, 12, 24):
        shares = evaluated(k, repeats if given.short else max(repeats // 4, 20))
        print(
            f"| {k} | {shares['rate']:.3f} | {shares['wilson']:.3f} | {shares['graspsense']:.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
