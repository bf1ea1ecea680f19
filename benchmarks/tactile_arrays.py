"""Features of a tactile array beside MiniRocket on the same array and the same folds, each of which is a session.

    graspsense import palpation.toml --save trials
    python benchmarks/tactile_arrays.py trials taxels --aeon-python PATH

Each fold holds out one session: the first recording of every label, or the second, and so on. MiniRocket (A. Dempster,
D. F. Schmidt and G. I. Webb, KDD 2021) is that of aeon 1.6, which needs an environment of its own. It gets all cells
from the first sample to the last, at 128 times. `contact-image` gives the features of the same cells, and `quant`
those of gap and force without the cells.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from arguments import parser_of

POINTS = 128
CLASSIFIER = "extra-trees"


def main() -> int:
    parser = parser_of(__doc__)
    parser.add_argument("store", type=Path, nargs="?")
    parser.add_argument("arrays", nargs="?", default="", help="names of channels, comma-separated")
    parser.add_argument("--sessions", type=int, default=0, help="number of folds; 0: one for each order")
    parser.add_argument("--aeon-python", default="")
    given = parser.parse_args()
    if given.short:
        return short()
    if given.aeon_python == "--inside":
        return minirocket(given.store)
    from graspsense.evaluation.intervals import wilson
    from graspsense.store.stored_grasps import stored_grasps

    grasps = stored_grasps(given.store)
    traces = [grasp.trace() for grasp in grasps]
    labels = np.array([grasp.label for grasp in grasps])
    folds = sessions(labels, given.sessions)
    names = given.arrays.split(",")
    rows = {
        "`contact-image`": image_features(traces, names),
        "`quant`": features_of(traces, "quant"),
    }
    rows["`contact-image` and `quant`"] = np.concatenate([*rows.values()][:2], axis=1)
    answers = {f"{name} with `{CLASSIFIER}`": answered(table, labels, folds) for name, table in rows.items()}
    if given.aeon_python:
        answers["MiniRocket on the cells"] = asked(given.aeon_python, cells(traces, names), labels, folds)
    classes, counts = np.unique(labels, return_counts=True)
    print(
        f"{len(labels)} recordings of {len(classes)} labels, {len(np.unique(folds))} folds; majority {counts.max()}"
    )
    for name, answer in answers.items():
        right = int((np.asarray(answer) == labels).sum())
        low, high = wilson(right, len(labels))
        print(f"| {name} | {right} of {len(labels)} = {right / len(labels):.3f} ({low:.2f} to {high:.2f}) |")
    return 0


def short() -> int:
    """Recognise labels that are in the features, in folds of which each has every label."""
    labels = np.array([label for label in "abc" for _ in range(4)])
    folds = sessions(labels, 2)
    assert all(set(labels[folds == fold]) == set("abc") for fold in (0, 1))
    answers = answered(np.array([[ord(label)] for label in labels], dtype=float), labels, folds)
    assert (answers == labels).all()
    print(f"short: {len(labels)} of {len(labels)} made recordings recognised")
    return 0


def sessions(labels: np.ndarray, parts: int) -> np.ndarray:
    """Return the fold of each recording: its number among those of its label, which are stored in their order."""
    order = np.zeros(len(labels), dtype=int)
    for label in np.unique(labels):
        order[labels == label] = np.arange((labels == label).sum())
    return order * parts // (order.max() + 1) if parts else order


def cells(traces: list, names: list[str]) -> np.ndarray:
    """Return the cells of all arrays at common times, (recordings, cells, times)."""
    recordings = []
    for trace in traces:
        series = []
        for name in names:
            signal = trace.signals[name]
            flat = signal.cells.reshape(len(signal.t_s), -1)
            times = np.linspace(signal.t_s[0], signal.t_s[-1], POINTS)
            series += [np.interp(times, signal.t_s, flat[:, k]) for k in range(flat.shape[1])]
        recordings.append(series)
    return np.array(recordings)


def image_features(traces: list, names: list[str]) -> np.ndarray:
    parts = []
    for name in names:
        columns = int(np.prod(traces[0].signals[name].cells.shape[1:]))
        parts.append(features_of(traces, "contact-image", array=name, rows=1, columns=columns))
    return np.concatenate(parts, axis=1)


def features_of(traces: list, name: str, **settings: object) -> np.ndarray:
    from graspsense.plugin_api import create

    extract = create("feature-set", name, **settings).extract
    return np.array([extract(trace).values for trace in traces], dtype=float)


def answered(features: np.ndarray, labels: np.ndarray, folds: np.ndarray) -> np.ndarray:
    from graspsense.core.settings.selected import select_component
    from graspsense.evaluation.crossval import cross_validate
    from graspsense.plugin_api import FeatureTable

    names = tuple(f"f{k}" for k in range(features.shape[1]))
    table = FeatureTable(names=names, units=("1",) * len(names), values=features)
    learner = select_component("classifier", CLASSIFIER)
    return np.array(cross_validate(learner, table, labels.tolist(), folds).predicted)


def asked(python: str, series: np.ndarray, labels: np.ndarray, folds: np.ndarray) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cells.npz"
        np.savez(path, series=series, labels=labels, folds=folds)
        command = [python, __file__, str(path), "cells", "--aeon-python=--inside"]
        answer = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(answer.stdout.splitlines()[-1])


def minirocket(path: Path) -> int:
    from aeon.classification.convolution_based import MiniRocketClassifier

    data = np.load(path)
    series, labels, folds = data["series"], data["labels"], data["folds"]
    answers = labels.copy()
    for fold in np.unique(folds):
        test = folds == fold
        model = MiniRocketClassifier(random_state=0).fit(series[~test], labels[~test])
        answers[test] = model.predict(series[test])
    print(json.dumps(answers.tolist()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
