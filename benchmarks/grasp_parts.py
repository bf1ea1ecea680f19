"""Where the time of a grasp in a batch goes: the compiled loop, and what is done in Python around it.

    python benchmarks/grasp_parts.py [--repeats 40] [--json] [--short]

Grasps of the catalogue in turn with spread and features, hybrid controller, one thread, with pads and with ideal
sensors. Microseconds of processor for a grasp, each the mean over 220 grasps of the least of the repeats: the whole
grasp in slices as a batch runs it, the loop within it with the conversion of its arguments, and other parts by
themselves. Simulated.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from datetime import date
from typing import Any, Final

from timed_loop import TimedLoop

from graspsense.plugin_api import create
from graspsense_sim_gripper.batch.job import Storage, grasp_compiled
from graspsense_sim_gripper.batch.scenes import Scenes
from graspsense_sim_gripper.batch.threads import SLICE, job_of
from graspsense_sim_gripper.compiled.extraction import compiled_measure
from graspsense_sim_gripper.compiled.generator import compiled_generator
from graspsense_sim_gripper.compiled.loop_code import CompiledLoop, CompiledLoops
from graspsense_sim_gripper.compiled.padding import composition_of, padded
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.library import catalogue
from graspsense_sim_gripper.problem import GraspSetup
from graspsense_sim_gripper.random_numbers import NumpyGenerator

GRASPS: Final = 220


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=40)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="one repeat")
    given = parser.parse_args()
    repeats = 1 if given.short else given.repeats
    rows = {
        sensor: parts(SimConfig(sensor=sensor), repeats)  # type: ignore[arg-type]
        for sensor in ("pads", "ideal")
    }
    made = {"date": date.today().isoformat(), "load": round(os.getloadavg()[0], 1), "repeats": repeats}
    if given.json:
        print(json.dumps({"made": made, "us_a_grasp": rows}, indent=2))
        return
    print(", ".join(f"{key} {value}" for key, value in made.items()))
    for sensor, row in rows.items():
        for name, us in row.items():
            print(f"{sensor:<7}{name:<44}{us:7.1f} us")


def parts(config: SimConfig, repeats: int) -> dict[str, float]:
    """Return the microseconds of a grasp and of its parts."""
    law, features = create("controller", "hybrid"), create("feature-set", "chitta")
    job = job_of(config, law, {"extract": features.extract}, features=features)
    names, scenes = sorted(catalogue()), Scenes(job, generator_of=compiled_generator())
    for name in names:
        scenes.add(name, compiled=True)
    setups = [scenes.setup(names[k % len(names)], k) for k in range(GRASPS)]
    composition, storage = composition_of(config, setups[0]), Storage()
    loop, measure = CompiledLoops(type(law).step).of(composition), compiled_measure(job.extraction)
    grasp_compiled(job, setups[0], loop, storage, measure)
    timed_loop = TimedLoop(loop)

    def sampled(begin: int) -> list[GraspSetup]:
        return [scenes.setup(names[k % len(names)], k) for k in range(begin, min(begin + SLICE, GRASPS))]

    def whole(begin: int, loop: CompiledLoop = loop) -> None:
        for setup in sampled(begin):
            composition_of(config, setup)
            grasp_compiled(job, setup, loop, storage, measure)

    def of_each(part: Callable[[Any], Any]) -> Callable[[int], None]:
        def of_slice(begin: int) -> None:
            for setup in setups[begin : begin + SLICE]:
                part(setup)

        return of_slice

    def loop_only(begin: int) -> float:
        timed_loop.spent_s = 0.0
        whole(begin, timed_loop)
        return timed_loop.spent_s

    ways: dict[str, Callable[[int], Any]] = {
        "whole grasp": whole,
        "loop, within it": loop_only,
        "sampling, by itself": sampled,
        "filling the layout, by itself": of_each(padded),
    }
    if config.sensor == "pads":
        table = storage.buffers.pads.noise
        ways["noise of the first images, by itself"] = of_each(lambda setup: setup.noise().fill(table))
        ways["the same by numpy's own generator"] = of_each(
            lambda setup: NumpyGenerator(setup.seed).fill(table)
        )
    return {name: 1e6 * least / GRASPS for name, least in leasts(ways, repeats).items()}


def leasts(ways: dict[str, Callable[[int], Any]], repeats: int) -> dict[str, float]:
    """Return the seconds of all grasps in each way: of each slice the least, measured in turn.

    A way that returns a number has measured itself.
    """
    least: dict[tuple[str, int], float] = {}
    for _ in range(repeats):
        for begin in range(0, GRASPS, SLICE):
            for name, way in ways.items():
                began = time.thread_time()
                told = way(begin)
                spent = told if isinstance(told, float) else time.thread_time() - began
                least[name, begin] = min(spent, least.get((name, begin), spent))
    return {name: sum(least[name, begin] for begin in range(0, GRASPS, SLICE)) for name in ways}


if __name__ == "__main__":
    main()
