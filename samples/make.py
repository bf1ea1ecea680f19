"""Makes the sample files of this folder from simulated grasps: a feature table, two recordings, and a store.

    python samples/make.py

The store is made by `graspsense collect`, everything else through the Python interface.
"""

from __future__ import annotations

import csv
import shutil
import subprocess
import sys
from pathlib import Path

from graspsense import Trial, load_pipeline

FOLDER = Path(__file__).parent
LABELS = ("can:full_open", "can:empty_open", "odwalla:full_closed", "odwalla:empty_open")
TRIALS = 10
"""Trials of each label in the feature table."""
TOUCHING_N = 0.5
"""Force of both fingers from which on the other program says that they touch."""
STEP = 10
"""Every so many ticks of the simulated 1 kHz are a row of a recording: 100 Hz."""


def main() -> None:
    """Write every sample file anew."""
    pipeline = load_pipeline("default", options=["classifier.type=none"])
    trials = [
        (label, seed, pipeline.grasp(object=label, seed=seed)) for seed in range(TRIALS) for label in LABELS
    ]
    with (FOLDER / "features.csv").open("w", newline="") as file:
        table = csv.writer(file)
        names = trials[0][2].features.names
        units = trials[0][2].features.units
        table.writerow(["object", *(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))])
        for label, _, trial in trials:
            table.writerow([label, *(f"{value:.6g}" for value in trial.features.values)])
    for label, seed, trial in trials:
        if seed == 0 and label.startswith("can"):
            write_recording(FOLDER / "recordings" / f"{label.replace(':', '_')}_1.csv", trial)
    shutil.rmtree(FOLDER / "trials", ignore_errors=True)
    store = ["--save", str(FOLDER / "trials"), "--each", "2", "--seed", "1"]
    subprocess.run(
        [sys.executable, "-m", "graspsense", "collect", "--labels", "can:full_open,can:empty_open", *store],
        input="\n" * 20,
        text=True,
        check=True,
    )


def write_recording(path: Path, trial: Trial) -> None:
    """Write a grasp as another program would have: milliseconds, millimetres, and whether both fingers touch."""
    path.parent.mkdir(exist_ok=True)
    trace = trial.trace
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["stamp", "width", "left finger", "right finger", "both touch"])
        for k in range(0, len(trace), STEP):
            table.writerow(
                [
                    f"{trace.t_s[k] * 1e3:.0f}",
                    f"{trace.gap_m[k] * 1e3:.3f}",
                    f"{trace.force_left_n[k]:.3f}",
                    f"{trace.force_right_n[k]:.3f}",
                    int(min(trace.force_left_n[k], trace.force_right_n[k]) >= TOUCHING_N),
                ]
            )


if __name__ == "__main__":
    main()
