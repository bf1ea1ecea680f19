"""Measure the processor time per trial of the experiments that come with graspsense.

    python benchmarks/experiment_times.py [NAME...] [--short]

Runs two tasks of each experiment in this process and writes `src/graspsense/experiments/durations.toml`, from which
`graspsense experiment` tells how long an experiment takes. Names measure these alone and keep the other figures.
`--short` measures the first of them and writes nothing.
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import time
import tomllib
from pathlib import Path

from graspsense.core.components.config import toml_key
from graspsense.experiments.executors.serial import Serial
from graspsense.experiments.experiment import number_of_trials, read_experiment, shipped

FILE = Path(__file__).parents[1] / "src/graspsense/experiments/durations.toml"


def seconds_per_trial(name: str) -> tuple[str, float]:
    """Return the kind of an experiment, and the processor seconds per trial of its last case.

    The first case with the first seed goes before: it imports, compiles and keeps curves for the page.
    """
    planned = read_experiment(name, ["seeds=2"])
    case = planned.cases[-1]
    for task in (planned.task(planned.cases[0], planned.seeds[0]), planned.task(case, planned.seeds[1])):
        (done,) = Serial().run([task])
        assert done.state == "done", done
    sources = [source for source in (case.data, case.test) if source is not None]
    trials = sum(number_of_trials(case.settings, source) or 0 for source in sources)
    return planned.experiment.kind, done.cpu_seconds / trials


def processor() -> str:
    """Return the model of the processor as Linux names it."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.is_file() else []
    models = [line.partition(": ")[2] for line in lines if line.startswith("model name")]
    speeds = [line.partition(": ")[2] for line in lines if line.startswith("cpu MHz")]
    speed = f" at {float(speeds[0]) / 1e3:.1f} GHz" if speeds else ""
    return (models[0] if models else platform.machine()) + speed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    asked = given.names or [name for name in shipped() if not read_experiment(name).parts]
    values = tomllib.loads(FILE.read_text()) if FILE.is_file() else {}
    shares, kinds = dict(values.get("seconds_per_trial", {})), dict(values.get("kinds", {}))
    for name in asked[:1] if given.short else asked:
        begun = time.monotonic()
        kinds[name], shares[name] = seconds_per_trial(name)
        print(
            f"{name}: {shares[name]:.4f} s per trial ({time.monotonic() - begun:.0f} s, "
            f"load {os.getloadavg()[0]:.1f})",
            flush=True,
        )
        if given.short:
            return
        lines = [
            "# Written by benchmarks/experiment_times.py: processor seconds per trial of each experiment.",
            f'processor = "{processor()}"',
            f'date = "{datetime.date.today().isoformat()}"',
            "",
            "[seconds_per_trial]",
            *(f"{toml_key(key)} = {shares[key]:.3g}" for key in sorted(shares)),
            "",
            "[kinds]",
            *(f'{toml_key(key)} = "{kinds[key]}"' for key in sorted(kinds)),
        ]
        FILE.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
