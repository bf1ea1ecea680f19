"""Many simulated grasps at once, and the time of compiling.

    python benchmarks/simulation.py [--json] [--short] [--only many,number,compile] [--grasps 4000] [--repeats 10]

Many grasps (`many`): the catalogue in turn, with features, on one core and on all, with pads and with ideal sensors,
in turn; the median, the least and the most of the repeats. By their number (`number`): batches of a hundred to
`--largest` grasps on all cores. Compiling (`compile`): all of the catalogue in a fresh process, with an empty cache and
a full one. On a busy machine only processor times are meaningful. `--short` simulates 300 grasps once.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from statistics import median
from typing import Any, Final

from graspsense.experiments.versions import measured_on
from graspsense.plugin_api import create
from graspsense.sources.simulated import BATCH_WITHOUT_TRACES
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.run.batch import run_many
from graspsense_sim_gripper.scene.library import catalogue

SENSORS: Final = ("ideal", "pads")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="300 grasps once, nothing compiled anew")
    parser.add_argument("--only", default="many,number,compile")
    parser.add_argument("--grasps", type=int, default=4000)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--largest", type=int, default=10_000)
    parser.add_argument("--compile-once", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.compile_once:
        print(json.dumps(compile_catalogue()))
        return
    wanted = {"many"} if given.short else set(given.only.split(","))
    result: dict[str, Any] = {**measured_on()}
    if "compile" in wanted:
        result.update(compiling())
    if "many" in wanted:
        result.update(many(300, 1) if given.short else many(given.grasps, given.repeats))
    if "number" in wanted:
        result.update(by_number(given.largest))
    result["load_at_the_end"] = os.getloadavg()[0]
    if given.json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key:<32}{in_words(value)}")


def in_words(value: Any) -> str:
    """Return a value of the result as text."""
    if isinstance(value, dict) and "median" in value:
        return f"{value['median']:.0f} ({value['least']:.0f} to {value['most']:.0f})"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


# -------------------------------------------------------------------------------------------------- many


def many(n: int, repeats: int) -> dict[str, Any]:
    """Return grasps a second with features, of both sensors and with one worker and many, and the cost by number."""
    workers, rates = (1, os.cpu_count() or 1), dict[str, list[float]]()
    for sensor in SENSORS:
        run_batch(sensor, 100, 1)
    for _ in range(repeats):
        for sensor in SENSORS:
            for count in dict.fromkeys(workers):
                rates.setdefault(f"grasps_per_s_{sensor}_{count}_workers", []).append(
                    n / run_batch(sensor, n, count)["s"]
                )
    result: dict[str, Any] = {"grasps": n, "repeats": repeats}
    for name, values in rates.items():
        result[name] = {"median": median(values), "least": min(values), "most": max(values)}
    return result


def by_number(largest: int) -> dict[str, Any]:
    """Return the time of a grasp in batches of a hundred grasps and more, on all cores, and the memory."""
    counts = [count for count in (100, 1000, 10_000, 100_000) if count < largest] + [largest]
    result: dict[str, Any] = {}
    for sensor in SENSORS:
        run_batch(sensor, 100, 1)
        result[f"by_number_{sensor}"] = {
            str(count): {
                "ms_on_the_clock_a_grasp": 1e3 * run["s"] / count,
                "ms_of_processor_a_grasp": 1e3 * run["processor_s"] / count,
                "largest_memory_mb": run["memory_mb"],
            }
            for count in counts
            for run in [run_batch(sensor, count, os.cpu_count() or 1)]
        }
    return result


def run_batch(sensor: str, n: int, workers: int) -> dict[str, float]:
    """Grasp the catalogue in turn with features; return the time on the clock and of all processors, and the memory.

    As the commands do, it runs parts of BATCH_WITHOUT_TRACES grasps with their reports, and keeps none.
    """
    law, features = create("controller", "hybrid"), create("feature-set", "chitta")
    names, backend = sorted(catalogue()), SimBackend(SimConfig(sensor=sensor))  # type: ignore[arg-type]
    backend.expect_features(features)
    began, spent = time.perf_counter(), sum(os.times()[:4])
    for begin in range(0, n, BATCH_WITHOUT_TRACES):
        seeds = range(begin, min(begin + BATCH_WITHOUT_TRACES, n))
        scenes = [names[k % len(names)] for k in seeds]
        backend.run_many(law, scenes, seeds, extract=features.extract, workers=workers)
    return {
        "s": time.perf_counter() - began,
        "processor_s": sum(os.times()[:4]) - spent,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


# ----------------------------------------------------------------------------------------------- compile


def compile_catalogue() -> dict[str, float]:
    """Compile for every object of the catalogue, or load that; return seconds on the clock and of processor."""
    law, names = create("controller", "hybrid"), sorted(catalogue())
    began, spent = time.perf_counter(), time.process_time()
    run_many(SimConfig(), law, names, range(len(names)), traces=False, compiled=True, workers=1)
    wall, cpu = time.perf_counter() - began, time.process_time() - spent
    began, again = time.perf_counter(), time.process_time()
    run_many(SimConfig(), law, names, range(len(names)), traces=False, compiled=True, workers=1)
    # The grasps themselves are no part of it.
    return {
        "wall": wall - (time.perf_counter() - began),
        "processor": cpu - (time.process_time() - again),
    }


def compiling() -> dict[str, Any]:
    """Return what compiling the catalogue takes with an empty and with a full cache: seconds of processor, and wall."""
    result: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "XDG_CACHE_HOME": folder}
        for name in ("compile_cold_s", "compile_warm_s"):
            done = subprocess.run(
                [sys.executable, __file__, "--compile-once"],
                env=environment,
                check=True,
                capture_output=True,
                text=True,
            )
            spent = json.loads(done.stdout)
            result[name] = spent["processor"]
            result[f"{name}_on_the_clock"] = spent["wall"]
    return result


if __name__ == "__main__":
    main()
