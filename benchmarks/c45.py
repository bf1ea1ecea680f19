"""The time that C4.5 takes to fit and to predict, beside scikit-learn's entropy tree at min_samples_leaf=25.

    python benchmarks/c45.py [--rows 1000 10000 ...] [--repeats N] [--short]

Times are CPU seconds of this process, the contenders taking turns; a ratio is one of medians.
"""

from __future__ import annotations

import importlib.util
import statistics
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from arguments import parser_of
from numpy.typing import NDArray

from graspsense.experiments.versions import where_measured
from graspsense.report.found_table import markdown_table

N_FEATURES = 6
N_CLASSES = 11
NOISE = 1.3
ROWS = (1_000, 10_000, 100_000, 1_000_000)


def grasp_like(n_rows: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Six features of eleven states: every state a centre, every feature of it normal noise of its own width."""
    rng = np.random.default_rng(0)
    centres = rng.normal(0.0, 2.0, (N_CLASSES, N_FEATURES))
    widths = NOISE * rng.uniform(0.5, 1.5, (N_CLASSES, N_FEATURES))
    states = rng.integers(0, N_CLASSES, n_rows)
    return centres[states] + widths[states] * rng.standard_normal((n_rows, N_FEATURES)), states


def contender(name: str) -> Any:
    """A fresh estimator."""
    if name == "sklearn":
        from sklearn.tree import DecisionTreeClassifier

        return DecisionTreeClassifier(criterion="entropy", min_samples_leaf=25, random_state=0)
    from graspsense_c45 import C45Classifier

    return C45Classifier(engine=name)


def seconds(work: Callable[[], Any]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def measure(n_rows: int, repeats: int, names: list[str]) -> list[list[str]]:
    """Return a row for each contender: median CPU seconds of fit and predict, with ratios, and the size of its tree."""
    x, y = grasp_like(n_rows)
    fits: dict[str, list[float]] = {name: [] for name in names}
    predicts: dict[str, list[float]] = {name: [] for name in names}
    nodes: dict[str, int] = {}
    for name in names:
        contender(name).fit(x[:200], y[:200]).predict(x[:200])
    for _ in range(repeats):
        for name in names:
            estimator = contender(name)
            fits[name].append(seconds(lambda e=estimator: e.fit(x, y)))  # type: ignore[misc]
            predicts[name].append(seconds(lambda e=estimator: e.predict(x)))  # type: ignore[misc]
            nodes[name] = estimator.tree_.node_count
    rows = []
    for name in names:
        cells = []
        for times in (fits, predicts):
            median_s = statistics.median(times[name])
            cells += [f"{median_s:.4f}", f"{median_s / statistics.median(times['sklearn']):.2f}"]
        rows.append([str(n_rows), name, *cells, str(nodes[name])])
    return rows


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--rows", type=lambda text: int(float(text)), nargs="+", default=list(ROWS))
    parser.add_argument("--repeats", type=int, default=5, help="fits of each contender")
    given = parser.parse_args()
    if given.short:
        given.rows, given.repeats = [1_000], 1
    names = ["sklearn", "plain", *(["fast"] if importlib.util.find_spec("numba") else [])]
    rows = [row for n_rows in given.rows for row in measure(n_rows, given.repeats, names)]
    print(f"{where_measured()}\n{N_FEATURES} features, {N_CLASSES} classes; CPU seconds, medians\n")
    header = ("rows", "contender", "fit s", "ratio", "predict s", "ratio", "nodes")
    print("\n".join(markdown_table(header, rows)))


if __name__ == "__main__":
    main()
