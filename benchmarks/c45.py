"""The time that C4.5 takes to fit and to predict, beside scikit-learn's entropy tree at min_samples_leaf=25.

    python benchmarks/c45.py [--rows 1000 10000 ...] [--repeats N] [--json] [--short]

Times are CPU seconds of this process, the contenders taking turns; a ratio is one of medians.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspsense.experiments.versions import measured_on

N_FEATURES = 6
N_CLASSES = 11
NOISE = 1.3
ROWS = (1_000, 10_000, 100_000, 1_000_000)
OURS = {"numpy": "numpy", "fast": "fast"}


def grasp_like(n_rows: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Six features of eleven states: every state a centre, every feature of it normal noise of its own width."""
    rng = np.random.default_rng(seed)
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

    return C45Classifier(engine=OURS[name])


def seconds(work: Callable[[], Any]) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def measure(n_rows: int, repeats: int, names: list[str]) -> dict[str, dict[str, float]]:
    """Median CPU seconds of fit and predict of each contender, and the size of its tree."""
    x, y = grasp_like(n_rows)
    fits: dict[str, list[float]] = {name: [] for name in names}
    predicts: dict[str, list[float]] = {name: [] for name in names}
    sizes: dict[str, float] = {}
    for name in names:
        contender(name).fit(x[:200], y[:200]).predict(x[:200])
    for _ in range(repeats):
        for name in names:
            estimator = contender(name)
            fits[name].append(seconds(lambda e=estimator: e.fit(x, y)))  # type: ignore[misc]
            for _ in range(3):
                predicts[name].append(seconds(lambda e=estimator: e.predict(x)))  # type: ignore[misc]
            sizes[name] = estimator.tree_.node_count
    return {
        name: {
            "fit_s": statistics.median(fits[name]),
            "predict_s": statistics.median(predicts[name]),
            "nodes": sizes[name],
        }
        for name in names
    }


def run_size(n_rows: int, repeats: int | None) -> dict[str, Any]:
    count = repeats or (30 if n_rows <= 1_000 else 10 if n_rows <= 10_000 else 5 if n_rows <= 100_000 else 2)
    names = ["sklearn", "numpy"]
    if importlib.util.find_spec("numba"):
        names.append("fast")
    print(f"{n_rows} rows, {count} fits each ...", file=sys.stderr)
    return {"rows": n_rows, "repeats": count, "contenders": measure(n_rows, count, names)}


def show(rows: list[dict[str, Any]], about: dict[str, str]) -> None:
    print(", ".join(f"{key} {value}" for key, value in about.items()))
    print(f"{N_FEATURES} features, {N_CLASSES} classes; CPU seconds, medians; ratios to scikit-learn\n")
    print(
        f"{'rows':>9} {'contender':>10} {'fit s':>10} {'ratio':>7} {'predict s':>10} {'ratio':>7} {'nodes':>8}"
    )
    smaller: dict[str, tuple[int, float]] = {}
    for row in rows:
        base = row["contenders"]["sklearn"]
        for name, times in row["contenders"].items():
            ratios = times["fit_s"] / base["fit_s"], times["predict_s"] / base["predict_s"]
            print(
                f"{row['rows']:>9} {name:>10} {times['fit_s']:>10.4f} {ratios[0]:>7.2f} "
                f"{times['predict_s']:>10.4f} {ratios[1]:>7.2f} {times['nodes']:>8.0f}",
                end="",
            )
            if name in smaller:
                exponent = np.log(times["fit_s"] / smaller[name][1]) / np.log(row["rows"] / smaller[name][0])
                print(f"   fit grows as rows^{exponent:.2f}", end="")
            smaller[name] = (row["rows"], times["fit_s"])
            print()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rows", type=lambda text: int(float(text)), nargs="+", default=list(ROWS))
    parser.add_argument(
        "--repeats", type=int, help="fits of each contender (default: 30 at 10^3 down to 2 at 10^6)"
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    arguments = parser.parse_args()
    if arguments.short:
        arguments.rows, arguments.repeats = [1_000], 1
    rows = [run_size(n, arguments.repeats) for n in arguments.rows]
    about = measured_on()
    if arguments.json:
        print(json.dumps({"machine": about, "rows": rows}, indent=1))
    else:
        show(rows, about)


if __name__ == "__main__":
    main()
