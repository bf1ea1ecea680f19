"""A posterior of the uncertain figures of the simulator, given the paper's results at 20 N. Simulated.

    python benchmarks/posterior.py --out FOLDER [--particles 50] [--generations 5] [--minutes 60] [--short]
    python benchmarks/posterior.py --out FOLDER --markdown docs/posterior.md

It infers the figures of `paper_model.PRIORS`, with the explanations of `paper_model.EXPLANATIONS`, by approximate
Bayesian computation with sequential Monte Carlo (pyABC; T. Toni et al., J. R. Soc. Interface 6 (2009) 187). The data
are Tables II and III of Chitta, Piccoli and Sturm (2010) and what the paper says of 20 N. Each simulation is one
replicate with the numbers of trials of the paper. The distance is the root of the sum of squared differences in
standard deviations of the published figures.

From the particles it predicts what was not used: Tables IV and V, section III.F, Figs. 4 to 6 and the splits of the
authors' tree at 23 N. Each explanation of the rise of the rate with the force is on or off with equal prior
probability, so the posterior odds are its Bayes factor.

Simulation-based calibration: each simulation from the prior is taken as the data in turn. The rank of its figures among
those of the nearest other simulations should be uniformly distributed.

Every step is kept in FOLDER, and a run that was stopped continues there; `--minutes` limits the time of the inference.
The result is `result.json`; `--markdown` writes the page from it. `--short` uses the least work, to show that it runs.
Needs the extra `inference`.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from datetime import date, timedelta
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

try:
    import pyabc
except ModuleNotFoundError:
    print("not run: needs pyabc (pip install graspsense[inference])")
    sys.exit(0)

from attrs import frozen
from paper_model import (
    EXPLANATIONS,
    NAMES,
    OFF_BELOW,
    PRIORS,
    Observed,
    gain,
    is_on,
    observed,
    predictions,
    rates_at_20_n,
)

from graspsense.experiments.paper.published import published
from graspsense.inference import (
    Prior,
    contraction,
    effective_sample_size,
    rank_histogram,
    rank_of,
    uniformity_p,
    weighted_quantiles,
)

LEVELS: Final = (0.025, 0.5, 0.975)
NEAREST: Final = 0.2
"""Share of the simulations that the calibration accepts for each of them."""
BINS: Final = 5
"""Parts of a rank histogram."""
SEEDS: Final = 1_000_000

Simulate = Callable[[Mapping[str, float]], dict[str, float]]


class Size(NamedTuple):
    """How much is computed."""

    particles: int
    generations: int
    minutes: float
    predicted: int
    """Particles that are predicted from, at most."""
    alone: int
    """Replicates of each explanation alone."""


class Weighted(NamedTuple):
    """A weighted sample: one row of figures and one weight for each particle."""

    values: list[dict[str, float]]
    weights: list[float]

    @property
    def weight(self) -> Any:
        """The weights as an array, with the sum 1."""
        w = np.array(self.weights)
        return w / w.sum()


def prior_of(name: str) -> Prior:
    """Return the prior of a figure; that of an explanation is uniform from 0 to 1."""
    if name not in EXPLANATIONS:
        return next(one for one in PRIORS if one.name == name)
    reason = EXPLANATIONS[name].reason
    return Prior(name=name, unit="1", law="uniform", args=(0.0, 1.0), origin="assumed", reason=reason)


def abc_of(simulate: Simulate, size: Size) -> pyabc.ABCSMC:
    """Return the inference, which is the same for the simulator and for its calibration."""
    priors = {name: pyabc.RV(prior_of(name).law, *prior_of(name).args) for name in NAMES}
    weights = {name: 1.0 / one.deviation for name, one in observed().items()}
    return pyabc.ABCSMC(
        simulate,
        pyabc.Distribution(priors),
        pyabc.PNormDistance(p=2, fixed_weights=weights),
        population_size=size.particles,
        eps=pyabc.MedianEpsilon(),
        sampler=pyabc.SingleCoreSampler(),
    )


def sample_of(history: pyabc.History) -> Weighted:
    """Return the particles of the last generation."""
    frame, weights = history.get_distribution()
    rows = [{name: float(row[name]) for name in NAMES} for _, row in frame.iterrows()]
    return Weighted(rows, [float(w) for w in weights])


def least_epsilon() -> float:
    """Return the distance that two replicates of the same model have on average; less is not to be asked for."""
    return math.sqrt(len(observed()))


@frozen
class Folder:
    """The files of a run."""

    path: Path

    def lines(self, name: str) -> list[dict[str, Any]]:
        """Return the finished lines of a file; a line that was cut off is left out."""
        file = self.path / name
        text = file.read_text(encoding="utf-8") if file.exists() else ""
        return [json.loads(line) for line in text.split("\n")[:-1] if line]

    def add(self, name: str, line: Mapping[str, Any]) -> None:
        """Append a line to a file."""
        with (self.path / name).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")


def infer(folder: Folder, size: Size, say: Callable[[str], None]) -> pyabc.History:
    """Run the inference, or continue it, until it has its generations or its time is over."""

    # Another state of the generators after each start, so that a continued run does not repeat its seeds.
    state = len(folder.lines("simulations.jsonl")) + 1
    rng = np.random.default_rng(state)
    np.random.seed(state)  # noqa: NPY002 (pyABC draws from it)

    def simulate(values: Mapping[str, float]) -> dict[str, float]:
        plain = {name: float(values[name]) for name in NAMES}
        statistics = rates_at_20_n(plain, int(rng.integers(SEEDS)))
        folder.add("simulations.jsonl", {"values": plain, "statistics": statistics})
        return statistics

    abc = abc_of(simulate, size)
    database = folder.path / "abc.db"
    begun = database.exists()
    wanted = {name: one.value for name, one in observed().items()}
    url = f"sqlite:///{database}"
    history = abc.load(url, 1, wanted) if begun else abc.new(url, wanted)
    left = size.generations - (history.n_populations if begun else 0)
    if left > 0:
        history = abc.run(
            minimum_epsilon=least_epsilon(),
            max_nr_populations=left,
            max_walltime=timedelta(minutes=size.minutes),
        )
    say(f"{history.n_populations} generations, {history.total_nr_simulations} simulations")
    return history


def predict(
    folder: Folder, sample: Weighted, generation: int, most: int, say: Callable[[str], None]
) -> list[dict[str, float]]:
    """Return one replicate of the predictions of each particle, or of the first `most`, whose order is by chance."""
    name = f"predictions-{generation}.jsonl"
    done = folder.lines(name)
    for k in range(len(done), min(len(sample.values), most)):
        done.append(predictions(sample.values[k], SEEDS + k))
        folder.add(name, done[-1])
        if k % 10 == 9:
            say(f"predictions of {k + 1} particles")
    return done


def gains_alone(folder: Folder, sample: Weighted, generation: int, draws: int) -> dict[str, list[float]]:
    """Return how much each explanation alone, at full strength, raises the rate from 17 to 23 N, and `none` of them.

    Each list has one replicate for each of `draws` particles, which are drawn by their weights.
    """
    name = f"alone-{generation}.jsonl"
    done = folder.lines(name)
    drawn = np.random.default_rng(0).choice(len(sample.values), draws, p=sample.weight)
    for k in range(len(done), draws):
        none = {**sample.values[drawn[k]], **dict.fromkeys(EXPLANATIONS, 0.0)}
        gains = {"none": gain(none, SEEDS + k)}
        gains.update({one: gain({**none, one: 1.0}, SEEDS + k) for one in EXPLANATIONS})
        folder.add(name, gains)
        done.append(gains)
    return {one: [gains[one] for gains in done] for one in ("none", *EXPLANATIONS)}


def calibrate(simulations: list[dict[str, Any]]) -> dict[str, list[float]]:
    """Return the rank of the true figures of each simulation in their posterior, given its statistics as data.

    The simulations are draws from the prior. The posterior of one is the share `NEAREST` of all others that are nearest
    to it, which is rejection at that tolerance.
    """
    deviations = {name: one.deviation for name, one in observed().items()}
    data = np.array([[s["statistics"][name] / d for name, d in deviations.items()] for s in simulations])
    values = {name: np.array([s["values"][name] for s in simulations]) for name in NAMES}
    ranks: dict[str, list[float]] = {name: [] for name in NAMES}
    accepted = max(2, round(NEAREST * (len(simulations) - 1)))
    for k, row in enumerate(data):
        distances = np.linalg.norm(data - row, axis=1)
        distances[k] = np.inf
        near = np.argsort(distances)[:accepted]
        for name, of in ranks.items():
            of.append(rank_of(values[name][k], values[name][near], np.ones(accepted)))
    return ranks


PREDICTED: Final[Mapping[str, tuple[str, Observed | None]]] = {
    "table_4_17": ("Table IV, 17 N", Observed(0.698, 0.047)),
    "table_4_20": ("Table IV, 20 N (96 trials)", Observed(0.833, 0.038)),
    "table_4_23": ("Tables IV and V, 23 N", Observed(0.948, 0.023)),
    "gain": ("Table IV, 23 N minus 17 N", Observed(0.25, 0.052)),
    "eleven_classes": ("section III.F, class and state, without water", Observed(0.638, 0.039)),
    "worn_bottles": ("section III.F, worn bottles, trained on new ones", Observed(0.81, math.nan)),
    "other_new_bottles": ("other new bottles, trained on new ones (not in the paper)", None),
    "full_open_longest": (
        "section III.F: share of runs in which full, open takes longest",
        Observed(1.0, math.nan),
    ),
    "f_steady_splits": (
        "section III.F: f_steady separates the empty states, above 0.9",
        Observed(0.9, math.nan),
    ),
    "p_steady_splits": ("section III.F: p_steady separates full, closed, above 0.9", Observed(0.9, math.nan)),
    "tree_delta_t": ("authors' tree: delta_t", Observed(1.0, math.nan)),
    "tree_peak": ("authors' tree: peak force", Observed(1.0, math.nan)),
    "tree_p_steady": ("authors' tree: p_steady", Observed(1.0, math.nan)),
    "tree_f_steady": ("authors' tree: f_steady", Observed(1.0, math.nan)),
    "tree": ("authors' tree as a whole", Observed(0.948, math.nan)),
    "fig_4_20_counts": ("Fig. 4: sum of a pad's cells at 20 N, counts", None),
    "fig_4_100_counts": ("Fig. 4: the same at 100 N", None),
    "fig_5_peak_n": ("Fig. 5: peak force on a block under force control, N", None),
    "fig_6_peak_n": ("Fig. 6: measured peak under hybrid control, N (at most 23)", Observed(23.0, math.nan)),
    "fig_6_rest_s": ("Fig. 6: from contact to rest, s", Observed(0.75, 0.25)),
}
"""What is predicted, with the published figure."""


def summarise(
    folder: Folder, history: pyabc.History, size: Size, say: Callable[[str], None]
) -> dict[str, Any]:
    """Return the result as JSON values."""
    sample = sample_of(history)
    generation = int(history.max_t)
    predicted = predict(folder, sample, generation, size.predicted, say)
    alone = gains_alone(folder, sample, generation, size.alone)
    say("explanations alone")
    populations = history.get_all_populations()
    used = populations[populations["t"] >= 0]
    from_prior = int(populations[populations["t"] <= 0]["samples"].sum())
    ranks = calibrate(folder.lines("simulations.jsonl")[:from_prior])
    w = sample.weight
    distances = history.get_weighted_distances(generation)
    return {
        "simulated": True,
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "pyabc": pyabc.__version__,
        "particles": len(sample.values),
        "generations": history.n_populations,
        "simulations": int(history.total_nr_simulations),
        "effective_sample_size": effective_sample_size(w),
        "epsilon": [float(one) for one in used["epsilon"]],
        "simulations_by_generation": [int(one) for one in used["samples"]],
        "least_epsilon": least_epsilon(),
        "median_distance": weighted_quantiles(distances["distance"], distances["w"], (0.5,))[0],
        "conditioned_on": {name: one._asdict() for name, one in observed().items()},
        "fitted": _fitted(history),
        "figures": _figures(sample),
        "predicted_particles": len(predicted),
        "predicted_effective_sample_size": effective_sample_size(w[: len(predicted)]),
        "predictions": _predictions(predicted, w[: len(predicted)]),
        "explanations": _explanations(sample, predicted, alone),
        "calibration": _calibration(ranks),
    }


def _fitted(history: pyabc.History) -> dict[str, list[float]]:
    """Return the interval of each statistic among the accepted simulations."""
    weights, statistics = history.get_weighted_sum_stats()
    return {
        name: list(weighted_quantiles([float(one[name]) for one in statistics], weights, LEVELS))
        for name in observed()
    }


def _figures(sample: Weighted) -> dict[str, Any]:
    found = {}
    for name in NAMES:
        one = contraction(prior_of(name), [v[name] for v in sample.values], sample.weight)
        prior = prior_of(name)
        found[name] = {
            "unit": prior.unit,
            "origin": prior.origin,
            "reason": prior.reason,
            "prior": list(one.prior),
            "posterior": list(one.posterior),
            "contraction": one.contraction,
        }
    return found


def _predictions(predicted: list[dict[str, float]], w: Any) -> dict[str, Any]:
    found = {}
    for name, (what, printed) in PREDICTED.items():
        values = np.array([one[name] for one in predicted], dtype=np.float64)
        known = ~np.isnan(values)
        found[name] = {
            "what": what,
            "published": None if printed is None else printed.value,
            "deviation": None if printed is None or math.isnan(printed.deviation) else printed.deviation,
            "mean": float(np.average(values[known], weights=w[known])),
            "interval": list(weighted_quantiles(values[known], w[known], (0.025, 0.975))),
        }
    return found


def _explanations(
    sample: Weighted, predicted: list[dict[str, float]], alone: Mapping[str, list[float]]
) -> dict[str, Any]:
    """Return the Bayes factor of each explanation, without and with Table IV, and the points that it gives."""
    every, w = sample.weight, sample.weight[: len(predicted)]
    printed = {one.id: one for one in published().rates}
    likelihood = np.zeros(len(w))
    for name in ("table_4_17", "table_4_23"):
        one = printed[name]
        assert one.n is not None
        deviation = math.sqrt(one.rate * (1.0 - one.rate) / one.n)
        rates = np.array([p[name] for p in predicted])
        likelihood -= 0.5 * ((rates - one.rate) / deviation) ** 2
    both = w * np.exp(likelihood - likelihood.max())
    both /= both.sum()
    gains = np.array([p["gain"] for p in predicted])
    found: dict[str, Any] = {
        "none": {
            "says": "none of them",
            "alone": _mean_of(alone["none"]),
        }
    }
    for name, one in EXPLANATIONS.items():
        on_of_all = np.array([is_on(name, v) for v in sample.values])
        on = on_of_all[: len(predicted)]
        found[name] = {
            "says": one.says,
            "reason": one.reason,
            "figure": one.figure,
            "full_strength": one.limit,
            "unit": one.unit,
            "at_20_n": _odds(on_of_all, every),
            "with_table_4": _odds(on, both),
            "gain_if_on": _mean(gains[on], w[on]) if on.any() else None,
            "gain_if_off": _mean(gains[~on], w[~on]) if (~on).any() else None,
            "alone": _mean_of(alone[name]),
        }
    return {
        "effective_sample_size_with_table_4": effective_sample_size(both),
        "gain_with_table_4": _mean(gains, both),
        "of": found,
    }


def _odds(on: Any, w: Any) -> dict[str, float]:
    """Return the probability that an explanation is on, its Bayes factor, and an interval for it.

    The interval is Wilson's of a share of as many independent particles as the effective sample size.
    """
    from graspsense.evaluation.intervals import Z

    p, n = float(w[on].sum()), effective_sample_size(w)
    centre = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
    half = Z / (1 + Z * Z / n) * math.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n))
    low, high = max(centre - half, 0.0), min(centre + half, 1.0)
    prior = (1.0 - OFF_BELOW) / OFF_BELOW
    return {
        "probability": p,
        "low": low,
        "high": high,
        "bayes_factor": p / max(1.0 - p, 1e-9) / prior,
        "bayes_factor_low": low / max(1.0 - low, 1e-9) / prior,
        "bayes_factor_high": high / max(1.0 - high, 1e-9) / prior,
    }


def _mean(values: Any, w: Any) -> dict[str, Any]:
    """Return the weighted mean and the 95 % interval of one replicate."""
    v = np.asarray(values, dtype=np.float64)
    return {
        "mean": float(np.average(v, weights=w)),
        "interval": list(weighted_quantiles(v, w, (0.025, 0.975))),
    }


def _mean_of(values: list[float]) -> dict[str, Any] | None:
    """Return the mean of independent replicates with its 95 % interval (Student's t), and their number.

    None for fewer than two.
    """
    from scipy.stats import t

    v, n = np.array(values), len(values)
    if n < 2:
        return None
    half = float(t.ppf(0.975, n - 1) * v.std(ddof=1) / math.sqrt(n))
    mean = float(v.mean())
    return {"mean": mean, "interval": [mean - half, mean + half], "replicates": n}


def _calibration(ranks: Mapping[str, list[float]]) -> dict[str, Any]:
    every = [rank for of in ranks.values() for rank in of]
    return {
        "runs": len(next(iter(ranks.values()))),
        "accepted": NEAREST,
        "bins": BINS,
        "histograms": {name: rank_histogram(of, BINS).tolist() for name, of in ranks.items()},
        "p": {name: uniformity_p(rank_histogram(of, BINS)) for name, of in ranks.items()},
        "all": rank_histogram(every, BINS).tolist(),
        "coverage_90": float(np.mean([0.05 <= rank <= 0.95 for rank in every])),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="folder of the run; it is continued if it exists")
    parser.add_argument("--particles", type=int, default=50)
    parser.add_argument("--generations", type=int, default=5)
    parser.add_argument("--minutes", type=float, default=60.0, help="limit of the time of the inference")
    parser.add_argument("--predicted", type=int, default=1000, help="particles to predict from, at most")
    parser.add_argument("--alone", type=int, default=20, help="replicates of each explanation alone")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    parser.add_argument(
        "--markdown", type=Path, help="write the page from the result of FOLDER, and run nothing"
    )
    given = parser.parse_args()
    if given.out is None and not given.short:
        parser.error("name a folder for the run: --out FOLDER")
    if given.markdown is not None:
        from posterior_page import page

        result = given.out / "result.json"
        if not result.exists():
            parser.error(f"{result} does not exist: make it by a run with --out {given.out}")
        given.markdown.write_text(page(json.loads(result.read_text(encoding="utf-8"))), encoding="utf-8")
        return
    logging.getLogger("ABC").setLevel(logging.WARNING)
    size = Size(given.particles, given.generations, given.minutes, given.predicted, given.alone)
    if given.short:
        size = Size(particles=4, generations=1, minutes=1.0, predicted=4, alone=2)
    began = time.time()

    def say(text: str) -> None:
        print(f"{text} ({time.time() - began:.0f} s)", file=sys.stderr)

    with tempfile.TemporaryDirectory() as place:
        folder = Folder(given.out or Path(place))
        folder.path.mkdir(parents=True, exist_ok=True)
        history = infer(folder, size, say)
        result = summarise(folder, history, size, say)
        text = json.dumps(result, indent=2)
        (folder.path / "result.json").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
