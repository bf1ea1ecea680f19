"""`graspsense compare` beside classifiers of others, on the same trials and folds.

    python benchmarks/recognition.py SOURCE [SOURCE ...] [--aeon-python PATH] [options of graspsense compare]

The candidates of graspsense, their trials and their folds are those of `graspsense compare` with the same options, by
the same functions. The classifiers of others (benchmarks/recognition_peers.py) get the whole recordings: gap and both
forces over time, from the first sample to the last. For that, SOURCE is a store (`graspsense import ... --save DIR`) or
`simulated`. With `--aeon-python`, the Python of an environment with aeon, MultiRocket-Hydra is among them.

With `--folds 5` there is a row of `graspsense train SOURCE --choose`: the rate of the whole procedure, whose choice for
each fold is made without this fold. Its time is that of all candidates.

Prints a table for each source as Markdown. For several sources, the mean over them follows, with the difference from
the best of the others and its 95 % interval: Student's t over the sources.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from arguments import parser_of
from scipy import stats

from graspsense.cli.choosing import chosen
from graspsense.cli.compare import compare, compared_trials
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import learner_of
from graspsense.cli.train import train
from graspsense.core.learn.labelled import Labelled
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.trace import Trace
from graspsense.evaluation.choosing import FOLDS
from graspsense.evaluation.intervals import percent, percentages
from graspsense.evaluation.ranking import OutsideAnswers, Ranking, protocols_of, rank
from graspsense.recording.reader import read_recorded
from graspsense.report.found_table import markdown_table
from graspsense.sources.trial_source import STORE, TrialSource, labelled_trials
from graspsense.store.store import COUNTS, Store

CLASSIFIERS = "c45,svm,forest"
FEATURE_SETS = "chitta,curve,quantiles,catch22"
CURVES = "whole curves"
POINTS = 128
"""Number of times of a curve."""
LONGEST = 0.95
"""Quantile of the durations up to which curves are compared; the last value of a shorter one goes on."""
SHORT = "--classifiers tree --feature-sets chitta,catch22 --instances 3 --trials 1 --folds 3"


def measured(source: str, given: argparse.Namespace, options: Sequence[str]) -> Ranking:
    """Return the comparison on a source, by its first protocol."""
    words = [source, "--classifiers", CLASSIFIERS, "--feature-sets", FEATURE_SETS, *options]
    with compare.make_context("graspsense compare", words) as context, ProgressLine() as progress:
        asked = context.params
        source = asked["source"]
        trials = compared_trials(source, asked["feature_sets"], asked["folds"], progress, asked)
        learners = {name: learner_of(source, name, asked) for name in asked["classifiers"].split(",")}
    first_trials = next(iter(trials.values()))
    headline, folds = next(iter(protocols_of(first_trials, asked["folds"], asked["seed"]).items()))
    outside = answers_of_others(
        first_trials, whole_curves(source, asked, first_trials), folds, given, asked["seed"]
    )
    if asked["folds"] == FOLDS and not given.short:
        outside |= answers_of_choice(source, first_trials, asked["seed"])
    return rank(
        learners,
        trials,
        seed=asked["seed"],
        protocols={headline: folds},
        outside={
            name: OutsideAnswers(predicted={headline: answer["predicted"]}, training_s=answer["training_s"])
            for name, answer in outside.items()
        },
        progress=told,
    )


def answers_of_choice(source: str, trials: Labelled, seed: int) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the answers of `graspsense train --choose` as a whole, which has the same outer folds.

    A trial that it does not recognise has an empty answer.
    """
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        words = [source, "--choose", "--seed", str(seed), "--out", str(Path(folder, "own.json"))]
        with train.make_context("graspsense train", words) as context:
            given = context.params
            choice = chosen(given["source"], None, given, lambda labelled: labelled).choice
    seconds = (time.perf_counter() - began) / (FOLDS + 1)
    predicted = [label if right else "" for label, right in zip(trials.labels, choice.right, strict=True)]
    return {("train --choose", "its choice"): {"predicted": predicted, "training_s": seconds}}


def whole_curves(source: str, asked: dict[str, Any], trials: Labelled) -> np.ndarray:
    """Return gap, larger and smaller force over the whole recordings on common times, shape (trials, channels, points).

    A channel that was not recorded, or that repeats another one, is left out.
    """
    traces: list[Trace] = []
    if source.startswith(STORE):
        with Store.read(source.removeprefix(STORE)) as store:
            query = f"SELECT recording, label FROM trial WHERE {COUNTS} AND label IS NOT NULL ORDER BY id"
            rows = store.query(query)
            labels = tuple(label for _, label in rows)
            if labels != trials.labels:
                raise SystemExit(
                    f"{source}: some recordings are copies or cannot be read; set them aside first"
                )
            traces = [read_recorded(store.recording_path(path)).trace() for path, _ in rows]
    elif source == "simulated":
        settings = resolve("default", options=("classifier.type=c45",))
        labelled_trials(
            TrialSource(source=source, instances=asked["instances"], trials=asked["trials"]),
            settings=lambda: settings,
            features=settings.features.create,
            seed=asked["seed"],
            on_trace=lambda number, label, trace: traces.append(trace),
        )
    else:
        raise SystemExit(
            f"{source}: the recordings are read from a store: graspsense import {source} --save DIR"
        )
    return sampled([curve_of(trace) for trace in traces])


def curve_of(trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Return the times from the first sample on, and gap, larger and smaller force, shape (3, n)."""
    pads = np.array([trace.force_left_n, trace.force_right_n])
    values = np.array([np.nan_to_num(trace.gap_m), np.fmax(*pads), np.fmin(*pads)])
    known = np.isfinite(values).all(axis=0) & np.isfinite(trace.t_s)
    return trace.t_s[known] - trace.t_s[known][0], values[:, known]


def sampled(curves: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return curves on common times, without channels that say nothing."""
    times = np.linspace(0.0, float(np.quantile([t[-1] for t, _ in curves], LONGEST)), POINTS)
    result = np.array([[np.interp(times, t, column) for column in values] for t, values in curves])
    used = [k for k in range(3) if np.ptp(result[:, k]) > 0.0]
    if 2 in used and np.array_equal(result[:, 1], result[:, 2]):
        used.remove(2)
    return result[:, used]


def answers_of_others(
    trials: Labelled, curves: np.ndarray, folds: np.ndarray, given: argparse.Namespace, seed: int
) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the predicted labels of the classifiers of others, by their names and that of their input."""
    answers_by_name: dict[tuple[str, str], dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as folder:
        data, answers = Path(folder, "trials.npz"), Path(folder, "answers.json")
        np.savez(
            data,
            curves=curves,
            labels=np.array(trials.labels),
            folds=folds,
        )
        script = str(Path(__file__).with_name("recognition_peers.py"))
        for python in filter(None, (sys.executable, given.aeon_python)):
            command = [python, script, str(data), str(answers), "--seed", str(seed)]
            environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": ""}
            if subprocess.run(command, check=False, env=environment).returncode:
                raise SystemExit(f"{' '.join(command)} failed")
            for name, answer in json.loads(answers.read_text(encoding="utf-8")).items():
                answers_by_name[name, CURVES] = answer
    return answers_by_name


def told(what: str, done: int, total: int) -> None:
    print(f"{time.strftime('%H:%M:%S')} {what} ({done + 1} of {total})", file=sys.stderr, flush=True)


def markdown(ranking: Ranking) -> str:
    """Return the verdict and the table of a comparison."""
    rows = []
    for candidate in ranking.candidates:
        rate, sets = candidate.rates[ranking.protocol], candidate.sets
        interval = f" ({percentages(rate.interval)})" if rate.interval else ""
        names = (candidate.classifier, candidate.features)
        covered = sets.covered if sets is not None else None
        rows.append(
            (
                *(names if sets is None else (f"`{name}`" for name in names)),
                percent(rate.rate) + interval,
                "" if candidate.loss is None else candidate.loss.points,
                candidate.standing,
                "" if covered is None else percent(covered.rate),
                f"{candidate.training_s:.2g} s",
            )
        )
    heads = ("classifier", "features", "recognised", "loss in points", "standing", "sets cover", "training")
    compared = f"{ranking.trials} {ranking.source}, compared by {ranking.protocol.replace('_', ' ')}."
    notes = (f"- {note}" for note in ranking.notes)
    return "\n".join((f"{compared} {ranking.verdict}", "", *markdown_table(heads, rows), "", *notes))


def mean_over(rankings: Sequence[Ranking]) -> list[str]:
    """Return a table of the means over the sources, with the differences from the best of the others."""
    rates: dict[str, list[float]] = {}
    for ranking in rankings:
        for candidate in ranking.candidates:
            name = f"{candidate.classifier} with {candidate.features}"
            rates.setdefault(name, []).append(100.0 * candidate.rates[ranking.protocol].rate)
    complete = {name: np.array(shares) for name, shares in rates.items() if len(shares) == len(rankings)}
    others = [name for name in complete if name.endswith(CURVES)]
    best = max(others, key=lambda name: complete[name].mean())
    rows = []
    for name, shares in sorted(complete.items(), key=lambda item: -item[1].mean()):
        apart = shares - complete[best]
        half = stats.t.ppf(0.975, len(shares) - 1) * apart.std(ddof=1) / np.sqrt(len(shares))
        words = f"{apart.mean():+.1f} ({apart.mean() - half:+.1f} to {apart.mean() + half:+.1f})"
        means = (f"{rate:.1f}" for rate in (*shares, shares.mean()))
        rows.append((name, *means, "" if name == best else words))
    sources = (ranking.source.rpartition(":")[2].rpartition("/")[2] for ranking in rankings)
    return markdown_table(("candidate", *sources, "mean", f"difference from {best}"), rows)


def main() -> None:
    words = sys.argv[1:]
    sources = list(takewhile(lambda word: not word.startswith("-"), words))
    parser = parser_of(__doc__)
    parser.add_argument("--aeon-python", metavar="PATH", help="the Python of an environment with aeon")
    given, options = parser.parse_known_args(words[len(sources) :])
    options += SHORT.split() if given.short else ()
    rankings = []
    for source in sources or ["simulated"]:
        rankings.append(measured(source, given, options))
        print(markdown(rankings[-1]), end="\n\n", flush=True)
    if len(rankings) > 1:
        print("\n".join(mean_over(rankings)))


if __name__ == "__main__":
    main()
