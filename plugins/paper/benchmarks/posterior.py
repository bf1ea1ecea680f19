"""A posterior of the uncertain figures of the simulator, given results of the paper. Simulated.

    python plugins/paper/benchmarks/posterior.py --out FOLDER --markdown FILE [--minutes 30] [--short]

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
it predicts what was not used: Tables IV and V, section III.F, Fig. 6 and the authors' tree at 23 N.
Each explanation of the rise of the rate with the force is on or off with equal prior probability, so the posterior odds
are its Bayes factor.

Simulation-based calibration: each simulation from the prior is taken as the data in turn, and its posterior is made
from the nearest other simulations, with the same weights and adjustment. The ranks of the true figures should be
uniform.

Every step is kept in FOLDER, and a run that was stopped continues there; `--minutes` limits the time of the inference.
FILE is the page with the tables. `--short` uses the least work, to show that it runs. Needs the extra `inference`.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
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

from graspsense.evaluation.intervals import Z, percent, percentages, wilson
from graspsense.experiments.versions import where_measured
from graspsense.report.simulation import markdown_table
from graspsense_paper.inference import (
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
SIMULATIONS: Final = "simulations.jsonl"
MIN_PARTICLES: Final = 5
"""Effective number of particles with an explanation, or without it, below which no Bayes factor is given."""
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


FULL: Final = Size(particles=150, generations=6, minutes=30.0, predicted=1000, alone=40)
SHORT: Final = Size(particles=4, generations=1, minutes=30.0, predicted=4, alone=2)


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


PREDICTED: Final[Mapping[str, tuple[str, Observed]]] = {
    "table_4_17": ("Table IV, 17 N", Observed(0.698, 0.047)),
    "table_4_20": ("Table IV, 20 N (96 trials)", Observed(0.833, 0.038)),
    "table_4_23": ("Tables IV and V, 23 N", Observed(0.948, 0.023)),
    "gain": ("Table IV, 23 N minus 17 N", Observed(0.25, 0.052)),
    "eleven_classes": ("section III.F, class and state, without water", Observed(0.638, 0.039)),
    "worn_bottles": ("section III.F, worn bottles, trained on new ones", Observed(0.81, math.nan)),
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
    "fig_6_peak_n": ("Fig. 6: measured peak under hybrid control, N (at most 23)", Observed(23.0, math.nan)),
    "fig_6_rest_s": ("Fig. 6: from contact to rest, s", Observed(0.75, 0.25)),
}
"""What is predicted, with the published figure."""


TITLES: Final = {
    "table_2": "Table II: container class",
    "table_3_odwalla": "Table III: state of an Odwalla bottle",
    "table_3_naked": "Table III: state of a Naked bottle",
    "table_3_can": "Table III: state of a can",
    "table_3_water": "Table III: state of a water bottle",
    "confused": "Table II: share of the errors that confuse Odwalla and Naked",
    "p_first_separates": "section III.F: what p_first lacks to separate 90 % of every other pair",
    "p_first_does_not_separate": "section III.F: what p_first separates above 90 % of Odwalla and Naked",
    "f_steady_separates": "section III.F: what f_steady lacks to separate 90 % of Odwalla and Naked",
}
"""What the inference is given."""


def page(folder: Folder, history: pyabc.History, size: Size, say: Callable[[str], None]) -> Iterator[str]:
    """Yield the lines of the page."""
    simulations = folder.lines(SIMULATIONS)
    near = nearest(simulations, history, NAMES, observed(), size.particles)
    sample = sample_of(near.scores, near.weights)
    predicted = predict(folder, sample, len(simulations), size.predicted, say)
    alone = gains_alone(folder, sample, len(simulations), size.alone)
    say("explanations alone")
    yield "# A posterior of the simulator's uncertain figures"
    yield ""
    yield (
        "All grasps are simulated, with models of gripper and objects. `docs/posterior.md` says what follows. "
        "Made by `python plugins/paper/benchmarks/posterior.py --out FOLDER --markdown FILE`, "
        f"{where_measured()}, pyABC {pyabc.__version__}."
    )
    yield ""
    yield from _inference(near, simulations)
    yield from _section(
        "What the data determine",
        "Median and 95 % interval. The contraction is 1 - var(posterior) / var(prior): 1 if the data determine a "
        "figure, 0 if they say nothing. The last figures are explanations: up to 0.5 an explanation is absent, above "
        "that its strength rises to its limit at 1.",
        ("figure", "unit", "origin", "reason", "prior", "posterior", "contraction"),
        _figures(sample),
    )
    yield from _section(
        "The data",
        "Published, its standard deviation, and the accepted simulations before the adjustment. A claim without a "
        "number counts by what is missing to it, with an assumed deviation of 5 points.",
        ("figure at 20 N", "published", "standard deviation", "accepted: median, 95 %"),
        _data(near),
    )
    yield from _section(
        "Predictions",
        "None of these were used for the inference. The interval is that of one replicate with the numbers of trials "
        f"of the paper, over {len(predicted)} particles.",
        ("figure", "published", "predicted mean", "95 % of one replicate", "published within that"),
        _predictions(predicted, sample.weight[: len(predicted)]),
    )
    yield from _section(
        "Explanations of the rise of the rate with the force",
        "Each explanation is on or off with equal prior probability, beside all other figures. The Bayes factor is the "
        "posterior odds that it is on, by the data at 20 N. Its interval counts the size of the sample, not the error "
        "of the adjustment. Points are the rate at 23 N minus that at 17 N, printed: +25.0. *Alone* is at full "
        "strength with all others off, whether or not the data at 20 N allow it; *explains* is that minus the rise "
        f"with none of them, in the same {len(alone['none'])} particles. Intervals are 95 % of the mean.",
        ("explanation", "Bayes factor, 20 N", "before the adjustment", "points alone", "explains"),
        _explanations(near, sample, predicted, alone),
    )
    yield from _calibration(simulations, history)


def _section(title: str, text: str, header: Sequence[str], rows: Iterator[tuple[str, ...]]) -> Iterator[str]:
    yield from ("", f"## {title}", "", text, "", *markdown_table(header, list(rows)))


def _inference(near: Sample, simulations: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield how large and how near to the data the sample is."""
    moved = np.average(np.abs(near.scores - near.unadjusted).mean(axis=1), weights=near.weights)
    (median,) = weighted_quantiles(near.distances, near.weights, (0.5,))
    from_prior = sum(simulation["t"] == 0 for simulation in simulations)
    yield (
        f"Of {len(simulations)} simulations, {from_prior} from the prior, the {len(near.weights)} nearest to the data "
        "are accepted, weighted by prior over proposals: the **effective sample size is "
        f"{effective_sample_size(near.weights):.1f}**. Their median distance is {median:.1f} and the greatest "
        f"{near.distances.max():.1f}; two replicates of the same model differ by about {least_epsilon():.1f}. The "
        f"adjustment to the data moves a score by {moved:.2f} on average. Where no accepted simulation is near the "
        "data, it extrapolates."
    )


def _range(quantiles: Sequence[float]) -> str:
    low, middle, high = quantiles
    return f"{middle:.3g} ({low:.3g} to {high:.3g})"


def _figures(sample: Weighted) -> Iterator[tuple[str, ...]]:
    for name in NAMES:
        prior = prior_of(name)
        contracted = contraction(prior, [v[name] for v in sample.values], sample.weight)
        ranges = _range(contracted.prior), _range(contracted.posterior)
        told = prior.unit, prior.origin, prior.reason
        yield f"`{name}`", *told, *ranges, f"{contracted.contraction:.2f}"


def _data(near: Sample) -> Iterator[tuple[str, ...]]:
    for name, printed in observed().items():
        simulated = [statistics[name] for statistics in near.statistics]
        low, middle, high = weighted_quantiles(simulated, near.weights, LEVELS)
        accepted = f"{percent(middle)} ({percentages((low, high))})"
        yield TITLES[name], percent(printed.value), percent(printed.deviation), accepted


def _predictions(predicted: list[dict[str, float]], w: Any) -> Iterator[tuple[str, ...]]:
    for name, (what, printed) in PREDICTED.items() if predicted else ():
        values = np.array([row[name] for row in predicted], dtype=np.float64)
        known = ~np.isnan(values)
        mean = float(np.average(values[known], weights=w[known]))
        low, high = weighted_quantiles(values[known], w[known], (0.025, 0.975))
        verdict = ""
        if not math.isnan(printed.deviation):
            verdict = "yes" if low <= printed.value <= high else "no"
        shown, least, mean_shown, most = (_shown(name, figure) for figure in (printed.value, low, mean, high))
        yield what, shown, mean_shown, f"{least} to {most}", verdict


def _shown(name: str, value: float) -> str:
    if name == "gain":
        return f"{100 * value:+.1f} points"
    return f"{value:.4g}" if name.startswith("fig_") else percent(value)


def _explanations(
    near: Sample, sample: Weighted, predicted: list[dict[str, float]], alone: Mapping[str, list[float]]
) -> Iterator[tuple[str, ...]]:
    """Yield the Bayes factors of the explanations, and the points that they give."""
    if predicted:
        w = sample.weight[: len(predicted)]
        gains = np.array([row["gain"] for row in predicted])
        mean = float(np.average(gains, weights=w))
        half = Z * math.sqrt(float(np.average((gains - mean) ** 2, weights=w)) / effective_sample_size(w))
        yield "as far as the data at 20 N allow", "", "", _points(mean, (mean - half, mean + half)), ""
    yield "none of them", "", "", _mean(alone["none"]), ""
    unadjusted = sample_of(near.unadjusted, near.weights)
    for name, explanation in EXPLANATIONS.items():
        strength = f"{explanation.limit:.3g} {explanation.unit}".removesuffix(" 1")
        factors = (
            factor([is_on(name, v) for v in some.values], some.weight) for some in (sample, unadjusted)
        )
        yield (
            f"{explanation.says} (`{explanation.figure}`, full strength {strength})",
            *factors,
            _mean(alone[name]),
            _mean(np.subtract(alone[name], alone["none"])),
        )
    yield "all of them", "", "", _mean(alone["all"]), _mean(np.subtract(alone["all"], alone["none"]))


def factor(on: Sequence[bool], w: Any) -> str:
    """Return the Bayes factor of an explanation with its interval, if enough particles have it, and do not have it.

    The interval is Wilson's of a share of as many independent particles as the effective sample size.
    """
    p, n = float(w[np.array(on)].sum()), effective_sample_size(w)
    fewer = n * min(p, 1.0 - p)
    if fewer < MIN_PARTICLES:
        return f"too few particles ({fewer:.0f})"
    prior = (1.0 - OFF_BELOW) / OFF_BELOW
    low, middle, high = (share / max(1.0 - share, 1e-9) / prior for share in sorted((p, *wilson(p * n, n))))
    return f"{middle:.2g} ({low:.2g} to {high:.2g})"


def _mean(values: Sequence[float]) -> str:
    """Return the mean of independent replicates with its 95 % interval (Student's t)."""
    if len(values) < 2:
        return "not simulated"
    mean = float(np.mean(values))
    return _points(mean, t.interval(0.95, len(values) - 1, mean, sem(values)))


def _points(mean: float, ends: tuple[float, float]) -> str:
    return f"{100 * mean:+.1f} ({100 * ends[0]:+.1f} to {100 * ends[1]:+.1f})"


def _calibration(simulations: list[dict[str, Any]], history: pyabc.History) -> Iterator[str]:
    scores = np.array([[simulation["scores"][name] for name in NAMES] for simulation in simulations])
    proposed = np.array([simulation["t"] for simulation in simulations])
    ranks = calibrate(simulations, mixture_weights(scores, proposed, history, NAMES))
    every = [rank for own in ranks.values() for rank in own]
    covered = float(np.mean([0.05 <= rank <= 0.95 for rank in every]))
    histograms = {name: rank_histogram(own, BINS) for name, own in ranks.items()}
    yield from _section(
        "Is the inference calibrated?",
        f"Each of {len(every) // len(ranks)} simulations that were drawn from the prior was taken as the data in turn. "
        f"Its posterior are the {percent(NEAREST)} of the others that are nearest to it, weighted and adjusted to "
        "it in the same way. A rank histogram counts where the true figure lies within this posterior; it should be "
        f"flat. Of all true figures, {percent(covered)} lie within the 90 % interval.",
        (
            "figure",
            f"ranks in {BINS} equal parts",
            f"p that it is flat (below {0.05 / len(ranks):.4f}: it is not)",
        ),
        (
            (f"`{name}`", " ".join(map(str, counts)), f"{uniformity_p(counts):.5f}")
            for name, counts in histograms.items()
        ),
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="folder of the run; it is continued if it exists")
    parser.add_argument("--markdown", type=Path, help="the page to write; printed without")
    parser.add_argument("--minutes", type=float, default=30.0, help="limit of the time of the inference")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    if given.out is None and not given.short:
        parser.error("name a folder for the run: --out FOLDER")
    logging.getLogger("ABC").setLevel(logging.WARNING)
    size = (SHORT if given.short else FULL)._replace(minutes=given.minutes)
    began = time.time()

    def say(text: str) -> None:
        print(f"{text} ({time.time() - began:.0f} s)", file=sys.stderr)

    with tempfile.TemporaryDirectory() as place:
        folder = Folder(given.out or Path(place))
        folder.path.mkdir(parents=True, exist_ok=True)
        text = "\n".join(page(folder, infer(folder, size, say), size, say)) + "\n"
    if given.markdown is None:
        print(text)
    else:
        given.markdown.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
