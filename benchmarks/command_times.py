"""Where the time of `evaluate simulated` and `train simulated` goes: seconds of processor by part. Simulated.

    python benchmarks/command_times.py [--repeats 3] [--instances 12] [--trials 5] [--json] [--short]

Each command runs in a process of its own, so that its start is part of it, with the defaults: 900 grasps. The first run
of a command selects and compiles what is not on disk yet, and does not count; of the others, the median is printed, and
the least and the greatest total. A part is the processor time of all threads while its function runs, without that of
the parts inside it. `--short` uses two grasps of each object, and one repeat.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from datetime import date
from functools import wraps
from typing import Any

SPENT: dict[str, float] = {}
STACK: list[float] = []


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--instances", type=int, default=12)
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--run", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.run:
        run(given.run)
        return
    if given.short:
        given.repeats, given.instances, given.trials = 1, 1, 2
    result: dict[str, Any] = {"made": made()}
    grasps = [f"--instances={given.instances}", f"--trials={given.trials}"]
    for command in ("evaluate", "train"):
        runs = [measured(command, grasps) for _ in range(given.repeats + 1)][1:]
        names = sorted({name for one in runs for name in one})
        parts = {name: statistics.median(one.get(name, 0.0) for one in runs) for name in names}
        totals = sorted(sum(one.values()) for one in runs)
        result[command] = {"parts": parts, "least": totals[0], "greatest": totals[-1]}
    if given.json:
        print(json.dumps(result, indent=2))
        return
    print(", ".join(f"{key} {value}" for key, value in result.pop("made").items()))
    for command, found in result.items():
        total = sum(found["parts"].values())
        print(
            f"\n{command} simulated: {total:.2f} s of processor ({found['least']:.2f} to {found['greatest']:.2f})"
        )
        for name, seconds in sorted(found["parts"].items(), key=lambda part: -part[1]):
            print(f"    {name:<32}{seconds:6.2f}{100.0 * seconds / total:6.0f} %")


def made() -> dict[str, Any]:
    return {
        "date": date.today().isoformat(),
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
    }


def measured(command: str, options: list[str]) -> dict[str, float]:
    """Return the seconds of the parts of one run of the command in a new process."""
    with tempfile.TemporaryDirectory() as folder:
        own = [f"--out={folder}/model.json"] if command == "train" else []
        done = subprocess.run(
            [sys.executable, __file__, "--run", command, "simulated", *options, *own],
            check=True,
            capture_output=True,
            text=True,
        )
    parts: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return parts


def run(arguments: list[str]) -> None:
    """Run a command in this process, and print the seconds of its parts as the last line."""
    import numba  # noqa: F401

    import graspsense.core.model as model
    from graspsense.cli.main import main as command
    from graspsense.evaluation import crossval, evaluate
    from graspsense_c45.plugin import C45
    from graspsense_sim_gripper.backend import SimBackend
    from graspsense_sim_gripper.batch import scenes, threads
    from graspsense_sim_gripper.compiled import loop_code

    SPENT["start: interpreter and imports"] = processor_s()
    for owner, name, part in (
        (scenes.Scenes, "add", "choosing reduced models"),
        (threads, "compiled_measure", "loading compiled features"),
        (loop_code, "_compiled", "loading the compiled loop"),
        (SimBackend, "run_many", "grasping"),
        (C45, "fit", "fitting trees"),
        (C45, "probabilities", "predicting"),
        (crossval, "novelty_of", "novelty"),
        (evaluate, "cross_validate", "cross-validation around fits"),
        (model, "train", "training around the fit"),
    ):
        setattr(owner, name, timed(part, getattr(owner, name)))
    loop_code.generating = loading(loop_code.generating)
    sys.argv = ["graspsense", *arguments]
    with contextlib.suppress(SystemExit):
        command()
    SPENT["everything else"] = processor_s() - sum(SPENT.values())
    print()
    print(json.dumps(SPENT))


def processor_s() -> float:
    """Return the processor time of this process and of those it started that have ended."""
    return sum(os.times()[:4])


def timed(part: str, function: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(function)
    def measured_function(*arguments: Any, **options: Any) -> Any:
        with counted(part):
            return function(*arguments, **options)

    return measured_function


@contextlib.contextmanager
def counted(part: str) -> Iterator[None]:
    """Count the processor time in this context to the part, and not to the part around it."""
    begun = processor_s()
    STACK.append(0.0)
    try:
        yield
    finally:
        spent = processor_s() - begun
        SPENT[part] = SPENT.get(part, 0.0) + spent - STACK.pop()
        if STACK:
            STACK[-1] += spent


def loading(generating: Callable[..., Any]) -> Callable[..., Any]:
    @contextlib.contextmanager
    def counted_loading(**options: Any) -> Iterator[None]:
        # In a thread of the batch, while the main thread waits in `run_many`.
        begun = processor_s()
        with generating(**options):
            yield
        spent = processor_s() - begun
        SPENT["loading the compiled loop"] = SPENT.get("loading the compiled loop", 0.0) + spent
        SPENT["grasping"] = SPENT.get("grasping", 0.0) - spent

    return counted_loading


if __name__ == "__main__":
    main()
