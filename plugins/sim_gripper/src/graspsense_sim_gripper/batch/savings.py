"""What the choice of a model saves in a batch, measured beside what a user would otherwise run."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

from attrs import evolve, frozen

from graspsense.plugin_api import NotCompilable, compiled_extraction
from graspsense_sim_gripper.batch.compiled_grasps import CompiledGrasps
from graspsense_sim_gripper.batch.job import Job
from graspsense_sim_gripper.batch.scenes import Scenes, scene_key
from graspsense_sim_gripper.batch.threads import WORTH_COMPILING
from graspsense_sim_gripper.build import build
from graspsense_sim_gripper.compiled.loop_code import CompiledLoops
from graspsense_sim_gripper.reduction.select import select_anew

WAYS: Final[Mapping[str, Mapping[str, Any]]] = {
    "in the chosen models": {},
    "with every term": {"fidelity": "full"},
    "in fixed steps of 1 ms": {"fidelity": "full", "scheme": "explicit", "step_s": 1e-3},
}
MOST_OBJECTS: Final = 24
ROUNDS: Final = 5
"""The grasps are timed this many times in turn; the least time of each way counts."""
LEAST_SAVED: Final = 0.02
"""A smaller share of the time of a grasp is noise."""


@frozen
class TimedBatch:
    """The grasps of a job, ready to run one by one in compiled code."""

    scenes: Sequence[str]
    seeds: Sequence[int]
    grasps: CompiledGrasps

    @classmethod
    def of(cls, job: Job, scenes: Sequence[str], seeds: Sequence[int]) -> TimedBatch:
        """Return the grasps of each scene with its seed. Raises ConfigError if a model cannot be selected."""
        known, loops = Scenes(job), CompiledLoops(type(job.controller).step)
        for scene in {scene_key(one): one for one in scenes}.values():
            known.add(scene, compiled=True)
        return cls(scenes, seeds, CompiledGrasps(known, loops))

    def seconds(self) -> float:
        """Return the processor time (s) of a grasp, the mean of all. Raises NotCompilable."""
        began = time.thread_time()
        for scene, seed in zip(self.scenes, self.seeds, strict=True):
            self.grasps.grasp(scene, seed)
        return (time.thread_time() - began) / len(self.scenes)


def savings(job: Job, scenes: Sequence[str], seeds: Sequence[int]) -> str:
    """Return in words what the chosen models of these scenes save, and what choosing them takes.

    One grasp of each object is run, of at most `MOST_OBJECTS`. Empty if nothing is chosen (`gripper.fidelity`,
    `scheme`, `step_s`), or if these are too few grasps to be compiled. Raises ConfigError if a model cannot be
    selected.
    """
    config = job.config
    if config.fidelity != "scene" or config.has_forced_steps or config.compile == "never":
        return ""
    if len(scenes) < WORTH_COMPILING:
        return ""
    form = None if job.features is None else compiled_extraction(job.features.extract)
    # Features are not extracted here, but the grasps end where those of the batch do.
    job = evolve(job, ends_with_hold=form is not None and not form.reads_release)
    first = {scene_key(scene): k for k, scene in reversed(list(enumerate(scenes)))}
    which = sorted(first.values())[:MOST_OBJECTS]
    scenes, seeds = [scenes[k] for k in which], [seeds[k] for k in which]
    least = dict.fromkeys(WAYS, float("inf"))
    try:
        batches = {
            way: TimedBatch.of(evolve(job, config=evolve(config, **settings)), scenes, seeds)
            for way, settings in WAYS.items()
        }
        for _ in range(ROUNDS):
            for way, batch in batches.items():
                least[way] = min(least[way], batch.seconds())
    except NotCompilable:
        return ""
    names = [scene for scene in scenes if scene != "none"]
    began = time.thread_time()
    for scene in names:
        select_anew(build(config, scene, job.scaled), job.grasp_controller, compiled=True)
    return in_words(list(least.values()), time.thread_time() - began, len(names))


def in_words(grasp_s: Sequence[float], selection_s: float, n_objects: int) -> str:
    """Return the result in words, given the processor times (s) of a grasp in each of `WAYS` and of selecting."""
    times = [f"{1e3 * s:.2f}" for s in grasp_s]
    times[0] += " ms a grasp"
    ways = ", ".join(" ".join(one) for one in zip(times, WAYS, strict=True))
    objects = "1 object" if n_objects == 1 else f"{n_objects} objects"
    # With every term the steps are chosen too. Only fixed steps need no choice.
    saved = grasp_s[2] - grasp_s[0]
    text = f"{ways}. Choosing the models of {objects} takes {selection_s:.2g} s, once"
    if saved < LEAST_SAVED * grasp_s[0]:
        return f"{text}. It saves no time here; its trial grasps show that the accuracy is kept"
    return f"{text}, and pays from {selection_s / saved:.0f} grasps on"
