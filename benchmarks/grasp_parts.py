"""Where the time of a grasp in a batch goes: the compiled loop, and what is done in Python around it.

    python benchmarks/grasp_parts.py [--repeats 40] [--json] [--short]

Grasps of the catalogue in turn with spread and features, hybrid controller, one thread, with pads and with ideal
sensors. Microseconds of processor for a grasp, each the mean over 220 grasps, of each slice of 16 the least of the
repeats: the whole grasp as a batch runs it, the loop within it with the conversion of its arguments, and other parts by
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

from timed_loop import TimedLoops

from graspsense.plugin_api import create
from graspsense_sim_gripper.batch.compiled_grasps import CompiledGrasps
from graspsense_sim_gripper.batch.scenes import Scenes
from graspsense_sim_gripper.batch.threads import job_of
from graspsense_sim_gripper.compiled.drawing import compiled_drawing
from graspsense_sim_gripper.compiled.extraction import compiled_measure
from graspsense_sim_gripper.compiled.generator import compiled_generator
from graspsense_sim_gripper.compiled.loop_code import CompiledLoops
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.library import catalogue
from graspsense_sim_gripper.random_numbers import Generator, NumpyGenerator

GRASPS: Final = 220
SLICE: Final = 16


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
    names, scenes = sorted(catalogue()), Scenes(job)
    for name in names:
        scenes.add(name, compiled=True)
    drawing, loops = compiled_drawing(), CompiledLoops(type(law).step)
    timed_loops = TimedLoops(loops)
    measure = compiled_measure(job.extraction)
    grasps, timed_grasps = (CompiledGrasps(scenes, one, measure) for one in (loops, timed_loops))
    part = [(names[k % len(names)], k) for k in range(GRASPS)]

    def whole(begin: int, grasps: CompiledGrasps = grasps) -> None:
        for scene, seed in part[begin : begin + SLICE]:
            grasps.grasp(scene, seed)

    def loop_only(begin: int) -> float:
        timed_loops.spent_s = 0.0
        whole(begin, timed_grasps)
        return timed_loops.spent_s

    memory = {name: scenes.drawn(name).scene.memory() for name in names}

    def drawn(begin: int) -> None:
        for name, seed in part[begin : begin + SLICE]:
            scenes.drawn(name).scene.drawn(drawing, seed, None, memory[name])

    table = grasps.storage.buffers.pads.noise

    def noise_of(generator: Generator) -> Callable[[int], None]:
        def of_slice(begin: int) -> None:
            for _ in part[begin : begin + SLICE]:
                generator.fill(table)

        return of_slice

    ways: dict[str, Callable[[int], Any]] = {
        "whole grasp": whole,
        "loop, within it": loop_only,
        "drawing, by itself": drawn,
    }
    if config.sensor == "pads":
        ways["noise of the first images, by itself"] = noise_of(compiled_generator()(0))
        ways["the same by numpy's own generator"] = noise_of(NumpyGenerator(0))
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
