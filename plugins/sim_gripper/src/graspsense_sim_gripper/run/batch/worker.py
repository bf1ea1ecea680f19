"""Simulating grasps of a batch in the interpreter of a separate process. The caller extracts the features."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from attrs import asdict

from graspsense.plugin_api import Controller
from graspsense.simulator_api import GraspProcess, HandedGrasp, RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.cache import restored, stored
from graspsense_sim_gripper.run.batch.job import FinishedGrasp, Job, grasp_plain
from graspsense_sim_gripper.run.batch.scenes import Scenes
from graspsense_sim_gripper.run.nested import Stored, TupleType, append

TARGET: Final = f"{__name__}:grasps_of"


class PlainProcess(GraspProcess):
    """A process that runs the grasps of a job in the interpreter. Raises NotHandedOver."""

    def __init__(self, scenes: Scenes) -> None:
        self._scenes = scenes
        job = scenes.job
        common = {
            "config": asdict(job.config),
            "models": [
                [*key, None if model is None else stored(model)] for key, model in scenes.models().items()
            ],
            "traces": job.traces or job.extract is not None,
            "ends_with_hold": job.ends_with_hold,
        }
        super().__init__(TARGET, job.controller, job.run, common)

    def run(self, scene: str, seed: int) -> FinishedGrasp:
        """Simulate a scene with a seed. Raises NotHandedOver as `GraspProcess.grasp` does."""
        job, handed = self._scenes.job, self.grasp(scene, seed)
        trace = handed.trace
        return FinishedGrasp(
            outcome=handed.outcome,
            reason=handed.reason,
            end=Stored(
                TupleType.made_of(self._scenes.setup(scene, seed).state),
                np.array(handed.further["state"], float),
            ),
            extracted=None if job.extract is None or trace is None else job.extract(trace),
            trace=trace if job.traces else None,
            model=self._scenes.find(scene).model,
        )


def grasps_of(
    controller: Controller[Any], run: RunConfig, common: Mapping[str, Any]
) -> Callable[[str, int], HandedGrasp]:
    """Return what runs a grasp in this process, as `GraspProcess` asks for it."""
    job = Job(
        config=SimConfig(**common["config"]),
        controller=controller,
        run=run,
        extract=None,
        traces=common["traces"],
        ends_with_hold=common["ends_with_hold"],
    )
    models = {
        (scene, numbered): None if values is None else restored(values)
        for scene, numbered, values in common["models"]
    }
    scenes = Scenes(job, models)

    def grasp(scene: str, seed: int) -> HandedGrasp:
        done, state = grasp_plain(job, scenes.setup(scene, seed)), list[float]()
        append(done.state, state, [])
        return HandedGrasp(done.outcome, done.reason, done.trace, {"state": state})

    return grasp
