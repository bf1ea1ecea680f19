"""A posterior of the uncertain figures of the simulator, given results of the paper. Simulated.

    python plugins/paper/benchmarks/posterior.py --out FOLDER
        [--particles 150] [--generations 6] [--minutes 30] [--short]
    python plugins/paper/benchmarks/posterior.py --out FOLDER --markdown plugins/paper/benchmarks/results/posterior.md

It infers the figures of `paper_model.PRIORS`, with the explanations of `paper_model.EXPLANATIONS`, by approximate
Bayesian computation with sequential Monte Carlo (pyABC; T. Toni et al., J. R. Soc. Interface 6 (2009) 187). Each
simulation is one replicate with the numbers of trials of the paper. The distance is the root of the sum of squared
differences in standard deviations of the published figures.

Every figure is inferred as its normal score: the quantile of a standard normal number at the probability that its
prior gives it. All priors are then alike and unbounded. New particles are drawn from a normal distribution with the
moments of the last generation, mixed with the prior (`NormalScores`), which keeps the weights bounded.

The sample is the simulations of all generations that are nearest to the data, each weighted by its prior density over
that of the mixture of all proposals (A. Owen and Y. Zhou, J. Am. Stat. Assoc. 95 (2000) 135). It is adjusted to the
data by linear regression of the normal scores on the simulated figures (M. A. Beaumont, W. Zhang and D. J. Balding,
Genetics 162 (2002) 2025).

The data are Tables II and III of Chitta, Piccoli and Sturm (2010) and what the paper says of 20 N. From the particles
it predicts what was not used: Tables IV and V, section III.F, Figs. 4 to 6 and the authors' tree at 23 N.
Each explanation of the rise of the rate with the force is on or off with equal prior probability, so the posterior odds
are its Bayes factor. With the rates of Table IV as data too, the odds are those of a logistic regression over the
particles, at the printed rates (M. A. Beaumont, in Simulations, Genetics and Human Prehistory (2008) 135).

Simulation-based calibration: each simulation from the prior is taken as the data in turn, and its posterior is made
from the nearest other simulations, with the same weights and adjustment. The ranks of the true figures should be
uniform.

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
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import date
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

try:
    import pyabc
except ModuleNotFoundError:
    print("not run: needs pyabc (pip install 'graspsense-paper[inference]')")
    sys.exit(0)

import pandas as pd
from attrs import frozen
from normal_scores import NormalScores, adjusted
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
from scipy.stats import norm, sem, t
from sklearn.linear_model import LogisticRegression

from graspsense.evaluation.intervals import Z, wilson
from graspsense_paper.inference import (
    Prior,
    contraction,
    effective_sample_size,
    rank_histogram,
    rank_of,
    uniformity_p,
    weighted_quantiles,
)
from graspsense_paper.published import published

LEVELS: Final = (0.025, 0.5, 0.975)
NEAREST: Final = 0.2
"""Share of the simulations that the calibration accepts for each of them."""
BINS: Final = 5
"""Parts of a rank histogram."""
SEEDS: Final = 1_000_000
SIMULATIONS: Final = "simulations.jsonl"
BOOTSTRAPS: Final = 400
"""Resamplings of the particles for the interval of a logistic regression."""
FARTHEST: Final = 5.0
"""Normal scores beyond this count as this, so that no figure is at the end of an unbounded prior."""

Simulate = Callable[[Mapping[str, float]], dict[str, float]]


class Size(NamedTuple):
    """How much is computed."""

    particles: int
    generations: int
    minutes: float
    """Limit of the time of the inference."""
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
        return next(prior for prior in PRIORS if prior.name == name)
    reason = EXPLANATIONS[name].reason
    return Prior(name=name, unit="1", law="uniform", args=(0.0, 1.0), origin="assumed", reason=reason)


def values_at(scores: Mapping[str, float]) -> dict[str, float]:
    """Return the figures with these normal scores."""
    return {
        name: float(_LAWS[name].ppf(norm.cdf(np.clip(scores[name], -FARTHEST, FARTHEST)))) for name in NAMES
    }


_LAWS: Final = {name: prior_of(name).distribution() for name in NAMES}


def abc_of(
    simulate: Simulate, names: Sequence[str], wanted: Mapping[str, Observed], particles: int
) -> pyabc.ABCSMC:
    """Return the inference of normal scores with these names, given these data."""
    return pyabc.ABCSMC(
        simulate,
        pyabc.Distribution({name: pyabc.RV("norm", 0.0, 1.0) for name in names}),
        pyabc.PNormDistance(
            p=2, fixed_weights={name: 1.0 / figure.deviation for name, figure in wanted.items()}
        ),
        population_size=particles,
        transitions=NormalScores(),
        eps=pyabc.MedianEpsilon(),
        sampler=pyabc.SingleCoreSampler(),
    )


class Sample(NamedTuple):
    """The accepted simulations: normal scores adjusted to the data, and unadjusted, weights, figures and distances."""

    scores: Any
    unadjusted: Any
    weights: Any
    statistics: list[dict[str, float]]
    distances: Any


def mixture_weights(scores: Any, proposed_in: Any, history: pyabc.History, names: Sequence[str]) -> Any:
    """Return the weight of each simulation: the density of the prior over that of the mixture of all proposals.

    `scores` has the shape (simulations, figures). `proposed_in` is 0 for a simulation from the prior, and k for one
    that was proposed from the moments of generation k - 1.
    """
    prior = norm.logpdf(scores).sum(axis=1)
    density = np.zeros(len(scores))
    for k in sorted(set(proposed_in.tolist())):
        share = float(np.mean(proposed_in == k))
        if k == 0:
            density += share
            continue
        frame, w = history.get_distribution(t=k - 1)
        proposal = NormalScores()
        proposal.fit(frame[list(names)], np.asarray(w))
        density += share * proposal.pdf(pd.DataFrame(scores, columns=list(names))) / np.exp(prior)
    return 1.0 / density


def nearest(
    simulations: Sequence[Mapping[str, Any]],
    history: pyabc.History,
    names: Sequence[str],
    wanted: Mapping[str, Observed],
    accepted: int,
) -> Sample:
    """Return the simulations that are nearest to the data, weighted and adjusted."""
    scores = np.array([[simulation["scores"][name] for name in names] for simulation in simulations])
    weights = mixture_weights(
        scores, np.array([simulation["t"] for simulation in simulations]), history, names
    )
    off = np.array(
        [[(s["statistics"][k] - o.value) / o.deviation for k, o in wanted.items()] for s in simulations]
    )
    distances = np.linalg.norm(off, axis=1)
    # By chance among each other, so that any part of them is a sample too.
    near = np.random.default_rng(0).permutation(np.argsort(distances)[:accepted])
    return Sample(
        scores=adjusted(scores[near], off[near], weights[near]),
        unadjusted=scores[near],
        weights=weights[near],
        statistics=[dict(simulations[i]["statistics"]) for i in near],
        distances=distances[near],
    )


def sample_of(scores: Any, w: Any) -> Weighted:
    """Return the figures of particles with these normal scores."""
    rows = [values_at(dict(zip(NAMES, row, strict=True))) for row in scores]
    return Weighted(rows, [float(weight) for weight in w])


def least_epsilon() -> float:
    """Return the distance of two replicates of the same model: the root mean square; less is not to be asked for.

    Claims without a number do not count: where they are met, they add nothing.
    """
    return math.sqrt(2.0 * sum(figure.value > 0.0 for figure in observed().values()))


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


class OutOfTime(Exception):
    """The time of the inference is over."""


def infer(folder: Folder, size: Size, say: Callable[[str], None]) -> pyabc.History:
    """Run the inference, or continue it, until it has its generations or its time is over."""
    wanted = observed()

    # Another state of the generators after each start, so that a continued run does not repeat its seeds.
    state = len(folder.lines(SIMULATIONS)) + 1
    rng = np.random.default_rng(state)
    np.random.seed(state)  # noqa: NPY002 (pyABC draws from it)

    end = time.monotonic() + 60.0 * size.minutes

    def simulate(scores: Mapping[str, float]) -> dict[str, float]:
        if time.monotonic() > end:
            raise OutOfTime
        plain = {name: float(scores[name]) for name in NAMES}
        statistics = rates_at_20_n(values_at(plain), int(rng.integers(SEEDS)))
        folder.add(SIMULATIONS, {"t": int(abc.history.max_t) + 1, "scores": plain, "statistics": statistics})
        return statistics

    abc = abc_of(simulate, NAMES, wanted, size.particles)
    database = folder.path / "abc.db"
    begun = database.exists()
    published = {name: figure.value for name, figure in wanted.items()}
    url = f"sqlite:///{database}"
    history = abc.load(url, 1, published) if begun else abc.new(url, published)
    left = size.generations - (history.n_populations if begun else 0)
    if left > 0:
        with suppress(OutOfTime):
            history = abc.run(minimum_epsilon=least_epsilon(), max_nr_populations=left)
    say(f"{history.n_populations} generations, {history.total_nr_simulations} simulations")
    return history


def predict(
    folder: Folder, sample: Weighted, simulations: int, most: int, say: Callable[[str], None]
) -> list[dict[str, float]]:
    """Return one replicate of the predictions of each particle, or of the first `most`, whose order is by chance."""
    name = f"predictions-{simulations}.jsonl"
    done = folder.lines(name)
    for k in range(len(done), min(len(sample.values), most)):
        done.append(predictions(sample.values[k], SEEDS + k))
        folder.add(name, done[-1])
        if k % 10 == 9:
            say(f"predictions of {k + 1} particles")
    return done


def gains_alone(folder: Folder, sample: Weighted, simulations: int, draws: int) -> dict[str, list[float]]:
    """Return how much each explanation alone, at full strength, raises the rate from 17 to 23 N, `none` and `all`.

    Each list has one replicate for each of `draws` particles, which are drawn by their weights.
    """
    name = f"alone-{simulations}.jsonl"
    done = folder.lines(name)
    drawn = np.random.default_rng(0).choice(len(sample.values), draws, p=sample.weight)
    cases = {
        "none": {},
        **{explanation: {explanation: 1.0} for explanation in EXPLANATIONS},
        "all": dict.fromkeys(EXPLANATIONS, 1.0),
    }
    for k in range(len(done), draws):
        none = {**sample.values[drawn[k]], **dict.fromkeys(EXPLANATIONS, 0.0)}
        done.append({case: gain({**none, **on}, SEEDS + k) for case, on in cases.items()})
        folder.add(name, done[-1])
    return {case: [gains[case] for gains in done] for case in cases}


def calibrate(simulations: list[dict[str, Any]], weights: Any) -> dict[str, list[float]]:
    """Return the rank of the true figures of each simulation in their posterior, given its statistics as data.

    The true ones are those that were drawn from the prior. The posterior of one is the share `NEAREST` of all others
    that are nearest to it, weighted and adjusted as the sample is.
    """
    deviations = {name: figure.deviation for name, figure in observed().items()}
    seen = np.array([[s["statistics"][name] / d for name, d in deviations.items()] for s in simulations])
    scores = np.array([[s["scores"][name] for name in NAMES] for s in simulations])
    ranks: dict[str, list[float]] = {name: [] for name in NAMES}
    accepted = max(2, round(NEAREST * (len(simulations) - 1)))
    for k, row in enumerate(seen):
        if simulations[k]["t"] != 0:
            continue
        distances = np.linalg.norm(seen - row, axis=1)
        distances[k] = np.inf
        near = np.argsort(distances)[:accepted]
        posterior = adjusted(scores[near], seen[near] - row, weights[near])
        for i, name in enumerate(NAMES):
            ranks[name].append(rank_of(scores[k, i], posterior[:, i], weights[near]))
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
    simulations = folder.lines(SIMULATIONS)
    nearby = nearest(simulations, history, NAMES, observed(), size.particles)
    w = nearby.weights
    sample = sample_of(nearby.scores, w)
    predicted = predict(folder, sample, len(simulations), size.predicted, say)
    alone = gains_alone(folder, sample, len(simulations), size.alone)
    say("explanations alone")
    from_each = Counter(simulation["t"] for simulation in simulations)
    scores = np.array([[simulation["scores"][name] for name in NAMES] for simulation in simulations])
    every = mixture_weights(scores, np.array([simulation["t"] for simulation in simulations]), history, NAMES)
    populations = history.get_all_populations()
    w_predicted = sample.weight[: len(predicted)]
    return {
        "simulated": True,
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}",
        "pyabc": pyabc.__version__,
        "particles": len(w),
        "simulations": len(simulations),
        "effective_sample_size": effective_sample_size(w),
        "generation_epsilon": [float(epsilon) for epsilon in populations["epsilon"][populations["t"] >= 0]],
        "simulations_by_proposal": [from_each[t] for t in sorted(from_each)],
        "epsilon": float(nearby.distances.max()),
        "least_epsilon": least_epsilon(),
        "median_distance": weighted_quantiles(nearby.distances, w, (0.5,))[0],
        "moved": float(np.average(np.abs(nearby.scores - nearby.unadjusted).mean(axis=1), weights=w)),
        "conditioned_on": {name: figure._asdict() for name, figure in observed().items()},
        "accepted": {
            name: list(weighted_quantiles([statistic[name] for statistic in nearby.statistics], w, LEVELS))
            for name in observed()
        },
        "figures": _figures(sample),
        "predicted_particles": len(predicted),
        "predicted_effective_sample_size": effective_sample_size(w_predicted) if predicted else 0.0,
        "predictions": _predictions(predicted, w_predicted),
        "explanations": _explanations(sample, sample_of(nearby.unadjusted, w), predicted, alone),
        "calibration": _calibration(calibrate(simulations, every)),
    }


def _figures(sample: Weighted) -> dict[str, Any]:
    figures = {}
    for name in NAMES:
        prior = prior_of(name)
        contracted = contraction(prior, [v[name] for v in sample.values], sample.weight)
        figures[name] = {
            "unit": prior.unit,
            "origin": prior.origin,
            "reason": prior.reason,
            "prior": list(contracted.prior),
            "posterior": list(contracted.posterior),
            "contraction": contracted.contraction,
        }
    return figures


def _predictions(predicted: list[dict[str, float]], w: Any) -> dict[str, Any]:
    predictions = {}
    for name, (what, printed) in PREDICTED.items() if predicted else ():
        values = np.array([row[name] for row in predicted], dtype=np.float64)
        known = ~np.isnan(values)
        predictions[name] = {
            "what": what,
            "published": None if printed is None else printed.value,
            "deviation": None if printed is None or math.isnan(printed.deviation) else printed.deviation,
            "mean": float(np.average(values[known], weights=w[known])),
            "interval": list(weighted_quantiles(values[known], w[known], (0.025, 0.975))),
        }
    return predictions


def _explanations(
    sample: Weighted,
    unadjusted: Weighted,
    predicted: list[dict[str, float]],
    alone: Mapping[str, list[float]],
) -> dict[str, Any]:
    """Return the Bayes factors of the explanations, without and with Table IV, and the points that they give."""
    every, w = sample.weight, sample.weight[: len(predicted)]
    gains = np.array([row["gain"] for row in predicted])
    rates = np.array([[row["table_4_17"], row["table_4_23"]] for row in predicted])
    printed = {rate.id: rate.rate for rate in published().rates}
    printed_rates = np.array([printed["table_4_17"], printed["table_4_23"]])
    by_name: dict[str, Any] = {}
    for name, explanation in EXPLANATIONS.items():
        on = np.array([is_on(name, v) for v in sample.values])
        of_predicted = on[: len(predicted)]
        by_name[name] = {
            "says": explanation.says,
            "figure": explanation.figure,
            "full_strength": explanation.limit,
            "unit": explanation.unit,
            "at_20_n": _odds(on, every),
            "before_adjustment": _odds(np.array([is_on(name, v) for v in unadjusted.values]), every),
            "with_table_4": _regressed_odds(of_predicted, w, rates, printed_rates),
            "gain_if_on": _mean(gains, w, of_predicted),
            "gain_if_off": _mean(gains, w, ~of_predicted),
            "alone": _mean_of(alone[name]),
            "explains": _mean_of(_differences(alone[name], alone["none"])),
        }
    return {
        "gain": _mean(gains, w, np.ones(len(gains), dtype=bool)),
        "greatest_gain": float(gains.max()) if predicted else None,
        "none": _mean_of(alone["none"]),
        "all": {
            "alone": _mean_of(alone["all"]),
            "explains": _mean_of(_differences(alone["all"], alone["none"])),
        },
        "of": by_name,
    }


def _regressed_odds(on: Any, w: Any, rates: Any, printed: Any) -> dict[str, float] | None:
    """Return the odds that an explanation is on at the rates `at`, by logistic regression on the simulated rates.

    The interval is that of resampled particles. None if the particles do not have both answers.
    """
    if not len(on) or on.all() or not on.any():
        return None
    spread = rates.std(axis=0) + 1e-9
    centred = (rates - printed) / spread
    size = max(round(effective_sample_size(w)), 4)
    rng, intercepts = np.random.default_rng(0), []
    for _ in range(BOOTSTRAPS):
        drawn = rng.choice(len(on), size, p=w / w.sum())
        if len(set(on[drawn])) == 2:
            intercepts.append(LogisticRegression().fit(centred[drawn], on[drawn]).intercept_[0])
    if not intercepts:
        return None
    middle = float(LogisticRegression().fit(centred, on, sample_weight=w * size / w.sum()).intercept_[0])
    low, high = np.quantile(intercepts, (0.025, 0.975))
    return dict(
        zip(
            ("bayes_factor", "bayes_factor_low", "bayes_factor_high"),
            (math.exp(log_odds) for log_odds in (middle, float(low), float(high))),
            strict=True,
        )
    )


def _differences(ones: Sequence[float], others: Sequence[float]) -> list[float]:
    return [a - b for a, b in zip(ones, others, strict=True)]


def _odds(on: Any, w: Any) -> dict[str, float]:
    """Return the probability that an explanation is on, its Bayes factor, and an interval for it.

    The interval is Wilson's of a share of as many independent particles as the effective sample size.
    """
    p, n = float(w[on].sum()), effective_sample_size(w)
    low, high = wilson(p * n, n)
    prior = (1.0 - OFF_BELOW) / OFF_BELOW
    return {
        "probability": p,
        "low": low,
        "high": high,
        "bayes_factor": p / max(1.0 - p, 1e-9) / prior,
        "bayes_factor_low": low / max(1.0 - low, 1e-9) / prior,
        "bayes_factor_high": high / max(1.0 - high, 1e-9) / prior,
    }


def _mean(values: Any, w: Any, chosen: Any) -> dict[str, Any] | None:
    """Return the weighted mean of those values, its 95 % interval, and that of one replicate; None without any."""
    if not chosen.any():
        return None
    v, w = np.asarray(values, dtype=np.float64)[chosen], w[chosen]
    mean, n = float(np.average(v, weights=w)), effective_sample_size(w)
    half = Z * math.sqrt(float(np.average((v - mean) ** 2, weights=w)) / n)
    return {
        "mean": mean,
        "interval_of_mean": [mean - half, mean + half],
        "interval": list(weighted_quantiles(v, w, (0.025, 0.975))),
        "effective_sample_size": n,
    }


def _mean_of(values: list[float]) -> dict[str, Any] | None:
    """Return the mean of independent replicates with its 95 % interval (Student's t), and their number.

    None for fewer than two.
    """
    n = len(values)
    if n < 2:
        return None
    interval = t.interval(0.95, n - 1, np.mean(values), sem(values))
    return {"mean": float(np.mean(values)), "interval": list(interval), "replicates": n}


def _calibration(ranks: Mapping[str, list[float]]) -> dict[str, Any]:
    every = [rank for own in ranks.values() for rank in own]
    return {
        "runs": len(next(iter(ranks.values()))),
        "accepted": NEAREST,
        "bins": BINS,
        "histograms": {name: rank_histogram(own, BINS).tolist() for name, own in ranks.items()},
        "p": {name: uniformity_p(rank_histogram(own, BINS)) for name, own in ranks.items()},
        "all": rank_histogram(every, BINS).tolist(),
        "coverage_90": float(np.mean([0.05 <= rank <= 0.95 for rank in every])),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="folder of the run; it is continued if it exists")
    parser.add_argument("--particles", type=int, default=150)
    parser.add_argument("--generations", type=int, default=6, help="at most")
    parser.add_argument("--minutes", type=float, default=30.0, help="limit of the time of the inference")
    parser.add_argument("--predicted", type=int, default=1000, help="particles to predict from, at most")
    parser.add_argument("--alone", type=int, default=40, help="replicates of each explanation alone")
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
        size = Size(particles=4, generations=1, minutes=30.0, predicted=4, alone=2)
    began = time.time()

    def say(text: str) -> None:
        print(f"{text} ({time.time() - began:.0f} s)", file=sys.stderr)

    with tempfile.TemporaryDirectory() as place:
        folder = Folder(given.out or Path(place))
        folder.path.mkdir(parents=True, exist_ok=True)
        result = summarise(folder, infer(folder, size, say), size, say)
        text = json.dumps(result, indent=2)
        (folder.path / "result.json").write_text(text + "\n", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
