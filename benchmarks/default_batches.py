"""What a default batch costs and how exact it is, beside fixed steps of 1 ms. Simulated.

    python benchmarks/default_batches.py [--instances 8] [--repeats 3] [--short]

Objects of the catalogue are grasped by the hybrid controller: with pads and spread for the times, with ideal sensors
and spread for the errors, which are those of `graspsense_sim_gripper.reduction.error` against the reference. Times are
processor times of a grasp in the compiled loop of the catalogue, medians of rounds in turn. `selection` is the time of
choosing the model of an object, without the cache on disk and once everything is compiled.
"""

from __future__ import annotations

import argparse
import time
from typing import Any, Final

import numpy as np
from attrs import evolve, frozen
from selection import record_of

from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import RunConfig, create
from graspsense_sim_gripper.batch.compiled_grasps import CompiledGrasps
from graspsense_sim_gripper.batch.job import FinishedGrasp, Job, grasp_plain
from graspsense_sim_gripper.batch.scenes import Scenes
from graspsense_sim_gripper.build import build
from graspsense_sim_gripper.compiled.loop_code import CompiledLoops
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.problem import GraspController
from graspsense_sim_gripper.reduction.error import deviation
from graspsense_sim_gripper.reduction.select import select_anew

OBJECTS: Final = (
    *("odwalla:full_open", "odwalla:full_closed", "naked:full_open", "naked:empty_open", "can:full_closed"),
    *("can:empty_open", "water:full_closed", "water:empty_closed", "water:empty_open", "toy", "block"),
)
VARIANTS: Final[dict[str, dict[str, Any]]] = {
    "fixed steps of 1 ms, explicit": {"fidelity": "scene", "scheme": "explicit", "step_s": 1e-3},
    "default, 10 %": {"accuracy": 0.1},
    "default, 1 %": {"accuracy": 0.01},
    "default, 0.1 %": {"accuracy": 0.001},
}
REFERENCE: Final = {"fidelity": "reference", "accuracy": 1e-4}


@frozen
class Batch:
    """The grasps of a variant, ready to run."""

    job: Job
    grasps: list[tuple[str, int]]
    """The scene and the seed of each."""
    compiled: CompiledGrasps | None
    """None: in the interpreter."""
    scenes: Scenes

    def grasp(self, i: int) -> FinishedGrasp:
        """Return grasp `i`."""
        if self.compiled is None:
            return grasp_plain(self.job, self.scenes.setup(*self.grasps[i]))
        done = self.compiled.grasp(*self.grasps[i])
        assert done is not None
        return done


def batch_of(
    objects: tuple[str, ...], instances: int, settings: dict[str, Any], *, compiled: bool, ideal: bool
) -> Batch:
    """Return the grasps of a variant, with seeds 0, 1, ..."""
    config = evolve(SimConfig(), sensor="ideal" if ideal else "pads", **settings)
    job = Job(
        config=config,
        controller=create("controller", "hybrid"),
        run=RunConfig(),
        extract=None,
        traces=ideal,
        features=create("feature-set", "chitta"),
    )
    scenes, loops = Scenes(job), CompiledLoops(type(job.controller).step)
    for name in objects:
        scenes.add(name, compiled=compiled)
    grasps = [(name, seed) for name in objects for seed in range(instances)]
    return Batch(job, grasps, CompiledGrasps(scenes, loops) if compiled else None, scenes)


def selection_s(objects: tuple[str, ...], settings: dict[str, Any], repeats: int, *, compiled: bool) -> float:
    """Return the processor time of selecting the steps of an object, with nothing cached; the median of all."""
    controller = GraspController(create("controller", "hybrid"), RunConfig(), create("feature-set", "chitta"))
    spent = []
    for name in objects * repeats:
        problem = build(evolve(SimConfig(), **settings), name)
        began = time.thread_time()
        select_anew(problem, controller, compiled=compiled)
        spent.append(time.thread_time() - began)
    return float(np.median(spent))


def measure(objects: tuple[str, ...], instances: int, repeats: int, *, compiled: bool) -> list[str]:
    """Return the figures in Markdown."""
    dt_s = 1.0 / SimConfig().rate_hz
    how = {"compiled": compiled}
    timed = {name: batch_of(objects, instances, one, ideal=False, **how) for name, one in VARIANTS.items()}
    spent: dict[str, list[float]] = {name: [] for name in VARIANTS}
    count = len(objects) * instances
    for k in range(repeats + 1):
        for name, batch in timed.items():
            began = time.thread_time()
            for i in range(count):
                batch.grasp(i)
            if k > 0:
                spent[name].append((time.thread_time() - began) / count)
    reference = batch_of(objects, instances, REFERENCE, ideal=True, **how)
    expected = [record_of(reference.grasp(i), dt_s) for i in range(count)]
    lines = [
        f"{count} grasps ({', '.join(objects)}); {where_measured()}.",
        "",
        "| variant | ms a grasp | least to greatest | median error | largest error | beyond the accuracy | "
        "selection, ms an object |",
        "|---|---|---|---|---|---|---|",
    ]
    chosen = {
        name: 1e3 * selection_s(objects, one, repeats, compiled=compiled) for name, one in VARIANTS.items()
    }
    for name, settings in VARIANTS.items():
        ideal = batch_of(objects, instances, settings, ideal=True, **how)
        errors = [deviation(record_of(ideal.grasp(i), dt_s), expected[i])[0] for i in range(count)]
        ms = [1e3 * one for one in spent[name]]
        beyond = sum(error > ideal.job.config.accuracy for error in errors)
        lines.append(
            f"| {name} | {np.median(ms):.3f} | {min(ms):.3f} to {max(ms):.3f} | {np.median(errors):.1e} "
            f"| {max(errors):.1e} | {beyond} of {count} "
            f"| {chosen[name]:.1f} |"
        )
    fixed, default = "fixed steps of 1 ms, explicit", "default, 1 %"
    saved = 1e3 * float(np.median(spent[fixed]) - np.median(spent[default]))
    extra = chosen[default] - chosen[fixed]
    lines += ["", f"At 1 %, a choice costs as much as {extra / saved:.0f} grasps save beside fixed steps."]
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--instances", type=int, default=8)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    objects, instances, repeats = (
        (("toy",), 1, 1) if given.short else (OBJECTS, given.instances, given.repeats)
    )
    print("\n".join(measure(objects, instances, repeats, compiled=not given.short)))


if __name__ == "__main__":
    main()
