"""The scenes of a batch, each with its steps."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from attrs import define, evolve, field

from graspsense_sim_gripper.run.accuracy.model import Reduction
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.batch.drawn import DrawnInstances, DrawnScene, StartLayout, drawn_scene
from graspsense_sim_gripper.run.batch.job import Job, started
from graspsense_sim_gripper.run.build import build, example_of, instantiate
from graspsense_sim_gripper.run.compiled.compose import Composition
from graspsense_sim_gripper.run.compiled.padding import padded
from graspsense_sim_gripper.run.model_report import GraspModel
from graspsense_sim_gripper.run.problem import GraspSetup, Problem
from graspsense_sim_gripper.run.sampled_loop import instability
from graspsense_sim_gripper.scene.library import split_number


@define
class Scenes:
    """The scenes of a job, each with its steps. All seeds of a scene share them."""

    job: Job
    selected: Mapping[tuple[str, bool], Reduction | None] = field(factory=dict)
    """Models that were selected elsewhere, by `scene_key`."""
    _scenes: dict[tuple[str, bool], tuple[Problem, Reduction | None]] = field(factory=dict, init=False)
    """By `scene_key`."""
    _problems: dict[str, tuple[Problem, Reduction | None]] = field(factory=dict, init=False)
    """By the name of the scene, with the number of the instance."""
    _examples: dict[tuple[str, bool], GraspSetup] = field(factory=dict, init=False)
    """What `example` returns, by `scene_key`."""
    _models: dict[tuple[str, bool], GraspModel] = field(factory=dict, init=False)
    """By `scene_key`."""
    _drawn_scenes: dict[tuple[str, bool], DrawnScene | None] = field(factory=dict, init=False)
    """By `scene_key`."""
    _layouts: dict[Composition, StartLayout] = field(factory=dict, init=False)
    _drawn: dict[str, DrawnInstances | None] = field(factory=dict, init=False)
    """What `drawn` returns, by the name of the scene, with the number of the instance."""

    def add(self, scene: str, *, compiled: bool = False) -> None:
        """Select the model of a scene. `compiled`: run the trial grasps compiled, not in the interpreter.

        Raises UnknownName and ConfigError as `build` and `select` do.
        """
        job, key = self.job, scene_key(scene)
        reduction = self.selected.get(key)
        problem = build(job.config, scene, job.scaled)
        if problem.spec is not None and reduction is None:
            reduction = select(problem, job.grasp_controller, compiled=compiled)
        self._scenes[key] = problem, reduction

    def models(self) -> dict[tuple[str, bool], Reduction | None]:
        """Return the models of the scenes that were added, by `scene_key`."""
        return {key: reduction for key, (_, reduction) in self._scenes.items()}

    def setup(self, scene: str, seed: int) -> GraspSetup:
        """Return the grasp of a scene with this seed. The model is selected if the scene was not added before.

        Raises as `add` and `instantiate` do.
        """
        known = self._problems.get(scene)
        if known is None:
            key = scene_key(scene)
            if key not in self._scenes:
                self.add(scene)
            problem, reduction = self._scenes[key]
            if key[1]:
                problem = evolve(problem, number=split_number(scene)[1])
            known = self._problems[scene] = problem, reduction
        return instantiate(*known, seed)

    def example(self, scene: str) -> GraspSetup:
        """Return any grasp of a scene, for what all of them have in common. Raises as `add` does."""
        key = scene_key(scene)
        if key not in self._examples:
            if key not in self._scenes:
                self.add(scene)
            self._examples[key] = example_of(*self._scenes[key])
        return self._examples[key]

    def drawn(self, scene: str) -> DrawnInstances | None:
        """Return what the compiled grasps of a scene are drawn from; None if each of them needs a `GraspSetup`."""
        if scene not in self._drawn:
            key = scene_key(scene)
            if key not in self._drawn_scenes:
                setup = self.example(scene)
                begun = started(self.job, padded(setup), on_arrays=True)
                self._drawn_scenes[key] = drawn_scene(*self._scenes[key], setup, begun, self._layouts)
            of_key = self._drawn_scenes[key]
            number = split_number(scene)[1] if key[1] else None
            self._drawn[scene] = None if of_key is None else DrawnInstances(of_key, number)
        return self._drawn[scene]

    def model_of(self, scene: str) -> GraspModel:
        """Return the model of a scene that was added."""
        key = scene_key(scene)
        known = self._models.get(key)
        if known is None:
            problem, reduction = self._scenes[key]
            kinds, unstable = () if problem.spec is None else problem.spec.kinds, ""
            if reduction is not None:
                unstable = instability(self.example(scene), self.job.grasp_controller, reduction)
            known = self._models[key] = GraspModel(kinds, reduction, unstable)
        return known


@lru_cache(maxsize=4096)
def scene_key(scene: str) -> tuple[str, bool]:
    """Return the key of a scene's model: the name without the number of an instance, and whether there is a number."""
    if scene == "none":
        return scene, False
    name, number = split_number(scene)
    return name, number is not None
