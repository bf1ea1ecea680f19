"""C4.5 beside its peers: fit, predict and memory, against scikit-learn's entropy tree at min_samples_leaf=25.

    python benchmarks/c45.py [--rows 1000 10000 ...] [--repeats N] [--json] [--short]

Peers in the same run: scikit-learn; Weka's J48 to 10^5 rows where Java is there and WEKA_JAR names weka.jar (3.9.6);
imodels to 10^3 rows where it is installed. Times are CPU seconds of this process (of Java: as it reports them), the
contenders taking turns; a ratio is one of medians. Memory is the peak above the loaded data, each contender in a
process of its own.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspsense.experiments.versions import measured_on

N_FEATURES = 6
N_CLASSES = 11
NOISE = 1.3
ROWS = (1_000, 10_000, 100_000, 1_000_000)
J48_ROWS, IMODELS_ROWS = 100_000, 1_000
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
    if name == "imodels":
        from imodels import C45TreeClassifier  # type: ignore[import-not-found]

        return C45TreeClassifier()
    from graspsense_c45 import C45Classifier

    return C45Classifier(engine=OURS[name])


def n_nodes(estimator: Any) -> float:
    """The size of its tree; NaN where it does not tell (imodels keeps XML)."""
    tree = getattr(estimator, "tree_", None)
    return float(getattr(tree, "node_count", float("nan")))


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
            sizes[name] = n_nodes(estimator)
    return {
        name: {
            "fit_s": statistics.median(fits[name]),
            "predict_s": statistics.median(predicts[name]),
            "nodes": sizes[name],
        }
        for name in names
    }


def peak_bytes(name: str, n_rows: int) -> int:
    """Peak memory of a fit above the loaded data, measured in a process of its own."""
    command = [sys.executable, __file__, "--peak-of", name, "--rows", str(n_rows)]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def print_own_peak(name: str, n_rows: int) -> None:
    x, y = grasp_like(n_rows)
    contender(name).fit(x[:200], y[:200])
    Path("/proc/self/clear_refs").write_text("5")
    baseline_bytes = _status("VmRSS")
    contender(name).fit(x, y)
    print(_status("VmHWM") - baseline_bytes)


def _status(key: str) -> int:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key):
            return int(line.split()[1]) * 1024
    raise KeyError(key)


JAVA = """
import java.io.*; import java.lang.management.*; import weka.core.*; import weka.classifiers.trees.J48;
public class TimeJ48 { public static void main(String[] a) throws Exception {
  Instances data = new Instances(new BufferedReader(new FileReader(a[0])));
  data.setClassIndex(data.numAttributes() - 1);
  ThreadMXBean clock = ManagementFactory.getThreadMXBean();
  for (int i = 0; i < Integer.parseInt(a[1]); i++) {
    long begin = clock.getCurrentThreadCpuTime(); J48 tree = new J48(); tree.buildClassifier(data);
    System.out.println((clock.getCurrentThreadCpuTime() - begin) * 1e-9 + " " + tree.measureTreeSize());
  } } }
"""


def time_j48(n_rows: int, repeats: int, jar: str) -> dict[str, float]:
    """J48's median CPU seconds for a fit, after one fit to warm up, and the size of its tree."""
    x, y = grasp_like(n_rows)
    with tempfile.TemporaryDirectory() as folder:
        source, table = Path(folder) / "TimeJ48.java", Path(folder) / "rows.arff"
        source.write_text(JAVA)
        with table.open("w") as out:
            out.write("@relation rows\n" + "".join(f"@attribute x{i} numeric\n" for i in range(N_FEATURES)))
            out.write(f"@attribute state {{{','.join(str(k) for k in range(N_CLASSES))}}}\n@data\n")
            for row, state in zip(x.tolist(), y.tolist(), strict=True):
                out.write(",".join(map(repr, row)) + f",{state}\n")
        command = ["java", "-cp", jar, str(source), str(table), str(1 + repeats)]
        answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    lines = [line.split() for line in answer.splitlines()][1:]
    return {"fit_s": statistics.median(float(line[0]) for line in lines), "nodes": float(lines[0][1])}


def run_size(n_rows: int, repeats: int | None, with_memory: bool) -> dict[str, Any]:
    count = repeats or (30 if n_rows <= 1_000 else 10 if n_rows <= 10_000 else 5 if n_rows <= 100_000 else 2)
    names = ["sklearn", "numpy"]
    if importlib.util.find_spec("numba"):
        names.append("fast")
    print(f"{n_rows} rows, {count} fits each ...", file=sys.stderr)
    measured = measure(n_rows, count, names)
    sklearn = measured["sklearn"]
    row: dict[str, Any] = {"rows": n_rows, "repeats": count}
    for name, suffix in (("numpy", ""), ("fast", "_fast")):
        ours = measured.get(name)
        row[f"fit_ratio{suffix}"] = ours and ours["fit_s"] / sklearn["fit_s"]
        row[f"predict_ratio{suffix}"] = ours and ours["predict_s"] / sklearn["predict_s"]
    if with_memory:
        peaks = {name: peak_bytes(name, n_rows) for name in names}
        # Below a few megabytes the pages of the process are coarser than what is to be measured.
        coarse = peaks["sklearn"] < 4_000_000
        row["memory_ratio"] = None if coarse else peaks["numpy"] / peaks["sklearn"]
        row["memory_ratio_fast"] = None if coarse or "fast" not in peaks else peaks["fast"] / peaks["sklearn"]
        row["peak_bytes"] = peaks
    if n_rows <= IMODELS_ROWS and importlib.util.find_spec("imodels"):
        measured |= measure(n_rows, 1, ["imodels"])
    jar = os.environ.get("WEKA_JAR")
    if n_rows <= J48_ROWS and jar and shutil.which("java"):
        measured["J48"] = {**time_j48(n_rows, 5 if n_rows <= 10_000 else 1, jar), "predict_s": float("nan")}
    row["contenders"] = measured
    return row


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
        if row.get("memory_ratio") is not None:
            peaks = ", ".join(f"{name} {peak / 1e6:.0f} MB" for name, peak in row["peak_bytes"].items())
            print(f"{'':>9} peak of a fit above the data: {peaks}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rows", type=lambda text: int(float(text)), nargs="+", default=list(ROWS))
    parser.add_argument(
        "--repeats", type=int, help="fits of each contender (default: 30 at 10^3 down to 2 at 10^6)"
    )
    parser.add_argument("--no-memory", action="store_true", help="leave the memory out (it needs Linux)")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    parser.add_argument("--peak-of", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.peak_of:
        print_own_peak(arguments.peak_of, arguments.rows[0])
        return
    if arguments.short:
        arguments.rows, arguments.repeats, arguments.no_memory = [1_000], 1, True
    with_memory = not arguments.no_memory and Path("/proc/self/clear_refs").exists()
    rows = [run_size(n, arguments.repeats, with_memory) for n in arguments.rows]
    about = measured_on()
    if arguments.json:
        # NaN is no JSON: a number nobody has is null.
        text = json.dumps({"machine": about, "rows": rows})
        print(json.dumps(json.loads(text, parse_constant=lambda _: None), indent=1))
    else:
        show(rows, about)


if __name__ == "__main__":
    main()
