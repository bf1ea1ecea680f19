"""How much faster than real time a grasp runs in the interpreter: plant, sensors, controller, guard, trace, features.

    python benchmarks/grasp.py [--json] [--short]

The grasp is that of `graspsense run --object block` (about 7 s on the gripper's clock). Given are the smallest
processor time of several grasps in a process that has run one before, the median and the largest (other work on the
machine delays some grasps), and the same for the compiled loop where numba is installed.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import time
from datetime import date
from importlib.metadata import version
from importlib.util import find_spec

from graspsense import load_pipeline
from graspsense.plugin_api import create

REPEATS = 25


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()

    pipeline = load_pipeline("default", options=["gripper.object=block", "classifier.type=none"])
    pipeline.grasp()
    taken = []
    for _ in range(1 if given.short else REPEATS):
        began = time.process_time()
        trial = pipeline.grasp()
        taken.append(time.process_time() - began)
    seconds, simulated = min(taken), trial.seconds_simulated or 0.0
    result = {
        "date": date.today().isoformat(),
        "machine": f"{platform.processor() or platform.machine()}, {platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "graspsense": version("graspsense"),
        "numpy": version("numpy"),
        "outcome": trial.outcome.words,
        "seconds_simulated": simulated,
        "seconds_cpu": seconds,
        "seconds_cpu_median": statistics.median(taken),
        "seconds_cpu_max": max(taken),
        "realtime_factor": simulated / seconds,
        "us_per_tick": 1e6 * seconds / (simulated * 1000.0),
        "realtime_factor_compiled": compiled_factor(simulated, 2 if given.short else 100),
    }
    if given.json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key:<26}{value if not isinstance(value, float) else round(value, 4)}")


def compiled_factor(simulated: float, many: int) -> float | None:
    """Return the factor of the compiled loop with its trace, from so many grasps; None without numba."""
    if find_spec("numba") is None:
        return None
    gripper = create("sensor-backend", "sim", object="block")
    controller = create("controller", "hybrid")
    gripper.run_many(controller, ["block"] * many, range(many), workers=1)
    began = time.process_time()
    gripper.run_many(controller, ["block"] * many, range(many), workers=1)
    return many * simulated / (time.process_time() - began)


if __name__ == "__main__":
    main()
