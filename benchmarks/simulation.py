"""Many simulated grasps at once, and the time of compiling.

    python benchmarks/simulation.py [--only many,compile] [--grasps 4000] [--repeats 10] [--short]

Many grasps (`many`): the catalogue in turn, with features, on one core and on all, with pads and with ideal sensors,
in turn; the median, the least and the most of the repeats, and the memory at the end. Compiling (`compile`): all of the
catalogue in a fresh process, with an empty cache and a full one. On a busy machine only processor times are meaningful.
`--short` simulates 300 grasps once.
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
from typing import Final

from arguments import parser_of

from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import create
from graspsense.sources.simulated import BATCH_WITHOUT_TRACES
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.scene.library import catalogue

SENSORS: Final = ("ideal", "pads")


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--only", default="many,compile")
    parser.add_argument("--grasps", type=int, default=4000)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--compile-once", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.compile_once:
        print(json.dumps(compile_catalogue()))
        return
    if given.short:
        given.only, given.grasps, given.repeats = "many", 300, 1
    print(where_measured())
    if "compile" in given.only:
        compiling()
    if "many" in given.only:
        many(given.grasps, given.repeats)


def many(n: int, repeats: int) -> None:
    """Print grasps a second with features, of both sensors and with one worker and many, and the largest memory."""
    rates: dict[str, list[float]] = {}
    for sensor in SENSORS:
        seconds_of_batch(sensor, 100, 1)
    for _ in range(repeats):
        for sensor in SENSORS:
            for workers in dict.fromkeys((1, os.cpu_count() or 1)):
                rate = n / seconds_of_batch(sensor, n, workers)
                rates.setdefault(f"{sensor}, {workers} workers", []).append(rate)
    for name, of_repeats in rates.items():
        least, most = min(of_repeats), max(of_repeats)
        print(f"{name}: {median(of_repeats):.0f} ({least:.0f} to {most:.0f}) grasps a second")
    print(f"largest memory: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


def seconds_of_batch(sensor: str, n: int, workers: int) -> float:
    """Grasp the catalogue in turn with features, and return the time on the clock (s).

    As the commands do, it runs parts of BATCH_WITHOUT_TRACES grasps with their reports, and keeps none.
    """
    law, features = create("controller", "hybrid"), create("feature-set", "chitta")
    names, backend = sorted(catalogue()), SimBackend(SimConfig(sensor=sensor))  # type: ignore[arg-type]
    backend.expect_features(features)
    began = time.perf_counter()
    for begin in range(0, n, BATCH_WITHOUT_TRACES):
        seeds = range(begin, min(begin + BATCH_WITHOUT_TRACES, n))
        scenes = [names[k % len(names)] for k in seeds]
        backend.run_many(law, scenes, seeds, extract=features.extract, workers=workers)
    return time.perf_counter() - began


def compile_catalogue() -> dict[str, float]:
    """Compile for every object of the catalogue, or load that; return seconds on the clock and of processor."""
    law, names = create("controller", "hybrid"), sorted(catalogue())
    gripper = SimBackend(SimConfig(compile="always"))
    began, spent = time.perf_counter(), time.process_time()
    gripper.run_many(law, names, range(len(names)), workers=1)
    wall, cpu = time.perf_counter() - began, time.process_time() - spent
    began, again = time.perf_counter(), time.process_time()
    gripper.run_many(law, names, range(len(names)), workers=1)
    # The grasps themselves are no part of it.
    return {
        "wall": wall - (time.perf_counter() - began),
        "processor": cpu - (time.process_time() - again),
    }


def compiling() -> None:
    """Print what compiling the catalogue takes with an empty and with a full cache."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "XDG_CACHE_HOME": folder}
        command = [sys.executable, __file__, "--compile-once"]
        for cache in ("empty", "full"):
            done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
            spent = json.loads(done.stdout)
            print(f"compiling, {cache} cache: {spent['processor']:.1f} s of processor, {spent['wall']:.1f} s")


if __name__ == "__main__":
    main()
