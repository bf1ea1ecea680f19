"""Every classifier with every feature set, beside MultiRocket-Hydra and a tuned boosted forest, on the same folds.

    python benchmarks/recognition.py [SOURCE ...] [--aeon-python PATH] [--instances N] [--trials N] [--seed S]

SOURCE is `simulated`, `icub:FOLDER` or `store:DIR`; without any it is `simulated`, and `icub:` with the folder that
GRASPSENSE_ICUB names. With `--aeon-python`, the Python of an environment with aeon, benchmarks/recognition_peers.py is
trained on the curves of the same trials and predicts the same folds. Prints the tables of
benchmarks/results/recognition.md as Markdown. The seeds 0 to 9 were used to choose defaults; a measurement uses another
one.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from attrs import evolve

from graspsense.core.components.config import build, resolve
from graspsense.core.components.registry import installed
from graspsense.core.components.roles import FeatureSet
from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.features import table_of
from graspsense.core.values.trace import Trace
from graspsense.evaluation.intervals import percentage, percentages
from graspsense.evaluation.ranking import OutsideAnswers, Ranking, protocols_of, rank
from graspsense.plugin_api import PluginUnavailable
from graspsense.plugins.features.contact_curve import contact_curve, samples_of
from graspsense.sources.trial_source import STORE, TrialSource, labelled_trials

CLASSIFIERS = ("c45", "tree", "knn", "svm", "mlp", "forest", "boosted", "ebm")
FEATURE_SETS = ("chitta", "curve", "quantiles", "catch22")
POINTS = 128
"""Number of times of a curve."""
CONTACT_FORCE_N = 0.625
ALL = "all features"
CURVES = "curves"


class Kept(FeatureSet[Any]):
    """Extracts the features of several sets and the curve of each trial; returns those of the first set."""

    def __init__(self, names: Sequence[str]) -> None:
        settings = {name: resolve("default", options=(f"features.type={name}",)).features for name in names}
        self.sets = {name: one.create() for name, one in settings.items()}
        first = next(iter(self.sets.values()))
        super().__init__(first.config)
        self.rows: dict[str, list[Any]] = {name: [] for name in names}
        self.curves: list[tuple[np.ndarray, np.ndarray]] = []

    def extract(self, trace: Trace) -> Any:
        for name, one in self.sets.items():
            self.rows[name].append(one.extract(trace))
        self.curves.append(curve_of(trace))
        return next(iter(self.rows.values()))[-1]

    def sampled(self) -> np.ndarray:
        """Return the curves on common times, shape (trials, channels, points); the last value goes on to the end."""
        lengths = [t[-1] for t, _ in self.curves if len(t) > 1]
        at = np.linspace(0.0, float(np.quantile(lengths, 0.95)), POINTS)
        result = np.zeros((len(self.curves), 4, POINTS))
        for k, (t, values) in enumerate(self.curves):
            for channel, column in enumerate(values):
                result[k, channel] = np.interp(at, t, column)
        return result


def curve_of(trace: Trace) -> tuple[np.ndarray, np.ndarray]:
    """Return the times from the contact on, and gap, compression and the larger and the smaller force of the pads.

    A trial without contact has zeros, as it has no features: what lies before the contact is a control of its own.
    """
    samples = samples_of(trace, CONTACT_FORCE_N)
    curve = samples if isinstance(samples, str) else contact_curve(samples, CONTACT_FORCE_N)
    if isinstance(curve, str):
        return np.zeros(1), np.zeros((4, 1))
    gap = curve.contact_gap_m - curve.compression_m
    return curve.t_s - curve.t_s[0], np.array(
        [gap, gap[0] - gap, curve.pads.max(axis=0), curve.pads.min(axis=0)]
    )


def trials_of(source: str, kept: Kept, given: argparse.Namespace) -> Labelled:
    """Return the trials of a source; `kept` has the features and the curves of all of them in the same order."""
    if source.startswith(STORE):
        return of_store(source, kept)
    described = TrialSource(source=source, instances=given.instances, trials=given.trials)
    settings = resolve("default", options=("classifier.type=c45",))
    simulated = source == "simulated"
    return labelled_trials(
        described,
        settings=lambda: settings,
        features=lambda: kept,
        seed=given.seed,
        on_trace=(lambda number, label, trace: kept.extract(trace)) if simulated else None,
    )


def of_store(source: str, kept: Kept) -> Labelled:
    from graspsense.recording.reader import read_recorded
    from graspsense.store.store import COUNTS, Store

    with Store.read(source.removeprefix(STORE)) as store:
        for (path,) in store.query(
            f"SELECT recording FROM trial WHERE {COUNTS} AND label IS NOT NULL ORDER BY id"
        ):
            kept.extract(read_recorded(store.recording_path(path)).trace())
    return labelled_trials(
        TrialSource(source=source),
        settings=lambda: resolve("default"),
        features=lambda: next(iter(kept.sets.values())),
    )


def measured(source: str, given: argparse.Namespace) -> Ranking:
    """Return the comparison on a source."""
    kept = Kept(given.feature_sets)
    trials = trials_of(source, kept, given)
    if len(kept.curves) != len(trials):
        raise SystemExit(f"{source}: {len(kept.curves)} traces for {len(trials)} trials of one feature set")
    tables = {name: evolve(trials, table=table_of(rows)) for name, rows in kept.rows.items()}
    folds = protocols_of(trials, given.folds, given.seed)
    headline = next(iter(folds))
    protocols = {name: of for name, of in folds.items() if name in (headline, "recording_order")}
    outside = {}
    if given.aeon_python:
        features = np.concatenate([one.table.values for one in tables.values()], axis=1)
        outside = peers(trials, features, kept.sampled(), protocols, given)
    learners = {name: component(name) for name in given.classifiers}
    return rank(learners, tables, seed=given.seed, protocols=protocols, outside=outside, progress=told)


def component(name: str) -> Any:
    from graspsense.core.components.config import SelectedComponent

    chosen = installed().find("classifier", name)
    return SelectedComponent(chosen, build(chosen, {}))


def peers(
    trials: Labelled,
    features: np.ndarray,
    curves: np.ndarray,
    protocols: Mapping[str, np.ndarray],
    given: argparse.Namespace,
) -> dict[tuple[str, str], OutsideAnswers]:
    """Return the answers of the classifiers in the other environment."""
    instances = trials.instances or tuple(str(k) for k in range(len(trials)))
    with tempfile.TemporaryDirectory() as folder:
        data, answers = Path(folder, "trials.npz"), Path(folder, "answers.json")
        np.savez(
            data,
            features=features,
            curves=curves,
            labels=np.array(trials.labels),
            instances=np.unique(instances, return_inverse=True)[1],
            protocols=np.array(list(protocols)),
            **{f"folds_{name}": of for name, of in protocols.items()},
        )
        script = Path(__file__).with_name("recognition_peers.py")
        command = [given.aeon_python, str(script), str(data), str(answers), "--seed", str(given.peer_seed)]
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": ""}
        if subprocess.run(command, check=False, env=environment).returncode:
            raise SystemExit(f"{' '.join(command)} failed")
        found = json.loads(answers.read_text(encoding="utf-8"))
    of = {"MultiRocket-Hydra": CURVES}
    return {(name, of.get(name, ALL)): OutsideAnswers(**one) for name, one in found.items()}


def told(what: str, done: int, total: int) -> None:
    print(f"{time.strftime('%H:%M:%S')} {what} ({done + 1} of {total})", file=sys.stderr, flush=True)


def markdown(ranking: Ranking) -> str:
    """Return the verdict and the table of a comparison."""
    protocols = list(dict.fromkeys(name for one in ranking.candidates for name in one.rates))
    header = ["classifier", "features", *(name.replace("_", " ") for name in protocols), "loss in points", "standing",
              "sets cover", "of labels below 90 %", "labels in a set", "training"]  # fmt: skip
    lines = [
        f"{ranking.trials} {ranking.source}, compared by {ranking.protocol.replace('_', ' ')}. {ranking.verdict}",
        "",
        f"| {' | '.join(header)} |",
        "|" + "---|" * len(header),
    ]
    for one in ranking.candidates:
        first = one.rates[ranking.protocol]
        interval = f" ({percentages(first.interval)})" if first.interval else ""
        rates = [percentage(one.rates[name].rate) if name in one.rates else "" for name in protocols]
        rates[protocols.index(ranking.protocol)] += interval
        covered = below = size = ""
        if one.sets is not None and one.sets.covered is not None and one.sets.mean_size is not None:
            covered, size = percentage(one.sets.covered.rate), f"{one.sets.mean_size:.2f}"
            if one.sets.covered_below is not None:
                below = percentage(one.sets.covered_below.rate)
        loss = "" if one.loss is None else one.loss.points
        cells = [
            f"`{one.classifier}`",
            f"`{one.features}`",
            *rates,
            loss,
            one.standing,
            covered,
            below,
            size,
            f"{one.training_s:.2g} s",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", *(f"- {note}" for note in ranking.notes)])


def names(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sources", nargs="*", metavar="SOURCE")
    parser.add_argument("--classifiers", type=names, default=CLASSIFIERS)
    parser.add_argument(
        "--feature-sets",
        type=names,
        default=None,
        help="[chitta, curve, quantiles, and catch22 if installed]",
    )
    parser.add_argument("--instances", type=int, default=20, help="simulated: instances of each object")
    parser.add_argument("--trials", type=int, default=3, help="simulated: grasps of each instance")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--seed", type=int, default=10)
    parser.add_argument("--aeon-python", metavar="PATH", help="the Python of an environment with aeon")
    parser.add_argument(
        "--peer-seed", type=int, help="of the random kernels of MultiRocket-Hydra [as --seed]"
    )
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    given.peer_seed = given.seed if given.peer_seed is None else given.peer_seed
    if given.feature_sets is None:
        given.feature_sets = tuple(name for name in FEATURE_SETS if is_installed(name))
    if not given.sources:
        icub = os.environ.get("GRASPSENSE_ICUB")
        given.sources = ["simulated", *([f"icub:{icub}"] if icub else [])]
    if given.short:
        given.sources, given.classifiers = ["simulated"], ("tree", "knn")
        given.instances, given.trials, given.folds = 3, 1, 3
    return given


def is_installed(name: str) -> bool:
    try:
        resolve("default", options=(f"features.type={name}",)).features.create()
    except PluginUnavailable:
        return False
    return True


def main() -> None:
    given = arguments()
    for source in given.sources:
        print(markdown(measured(source, given)), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
