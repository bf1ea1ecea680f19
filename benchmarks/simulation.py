"""Many simulated grasps at once, and the time of compiling.

    python benchmarks/simulation.py [--json] [--short] [--only many,compile] [--grasps 10000]

Many grasps: the catalogue in turn, with features, on all cores. Compiling: all of the catalogue in a fresh process,
with an empty cache and a full one. Values that were not measured are null. Only processor times are meaningful on a
busy machine. `--short` simulates 100 grasps. Other engines: `peers.py`.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from graspsense import __version__
from graspsense.plugin_api import BatchOptions, create
from graspsense_sim_gripper.batch import run_many
from graspsense_sim_gripper.batch.threads import grasps, job_of
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.library import catalogue


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="100 grasps, nothing compiled anew")
    parser.add_argument("--only", default="many,compile")
    parser.add_argument("--grasps", type=int, default=10_000)
    parser.add_argument("--compile-once", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.compile_once:
        print(json.dumps(compile_catalogue()))
        return
    wanted = {"many"} if given.short else set(given.only.split(","))
    result: dict[str, Any] = {"made": made()}
    if "compile" in wanted:
        result.update(compiling())
    if "many" in wanted:
        result.update(many(100 if given.short else given.grasps))
    result["load_at_the_end"] = os.getloadavg()[0]
    if given.json:
        print(json.dumps(finite(result), indent=2))
        return
    for key, value in result.items():
        print(f"{key:<34}{value if not isinstance(value, float) else f'{value:.4g}'}")


def made() -> dict[str, Any]:
    found: dict[str, Any] = {
        "date": date.today().isoformat(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "graspsense": __version__,
        "load_at_the_start": round(os.getloadavg()[0], 1),
    }
    for name in ("numpy", "numba", "scipy", "mujoco", "scikit-sundae"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


# -------------------------------------------------------------------------------------------------- many


def many(n: int) -> dict[str, Any]:
    """Return grasps a second with features, of ideal and of full sensing; the cost of one by how many there are."""
    law, features = create("controller", "hybrid"), create("feature-set", "chitta")
    names = sorted(catalogue())
    result: dict[str, Any] = {"grasps": n}
    for sensor, name in (("ideal", "grasps_per_s_ideal"), ("pads", "grasps_per_s_full")):
        config = SimConfig(sensor=sensor)  # type: ignore[arg-type]

        def run(count: int, config: SimConfig = config) -> tuple[float, float]:
            scenes = [names[k % len(names)] for k in range(count)]
            began, spent = time.perf_counter(), time.process_time()
            options: BatchOptions = {"extract": features.extract}
            job = job_of(config, law, options, features=features)
            # As the commands do, which keep no results but their own numbers.
            for _ in grasps(job, scenes, range(count), True, options):
                pass
            return time.perf_counter() - began, time.process_time() - spent

        run(len(names))
        counts = [c for c in (100, 1000, 10_000, 100_000) if c < n] + [n]
        by_count = {}
        for count in counts:
            wall, cpu = run(count)
            by_count[str(count)] = {
                "ms_of_processor_a_grasp": 1e3 * cpu / count,
                "largest_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            }
        result[name] = n / wall
        result[f"{name}_if_both_cores_were_free"] = (os.cpu_count() or 1) * n / cpu
        result[f"{name}_by_count"] = by_count
    return result


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
    if find_spec("numba") is None:
        return {"compile_cold_s": None, "compile_warm_s": None}
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
            found = json.loads(done.stdout)
            result[name] = found["processor"]
            result[f"{name}_on_the_clock"] = found["wall"]
    return result


def finite(value: Any) -> Any:
    """Return the value with null for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, list):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    main()
