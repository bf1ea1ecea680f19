"""The scenes of a batch, each with its steps."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache

from attrs import define, evolve, field

from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.batch.drawn import DrawnScene, drawn_scene
from graspsense_sim_gripper.run.batch.job import Job, started
from graspsense_sim_gripper.run.build import Problem, build, instantiate
from graspsense_sim_gripper.run.compiled.compose import Composition
from graspsense_sim_gripper.run.compiled.padding import composition_of, padded
from graspsense_sim_gripper.run.model_report import GraspModel
from graspsense_sim_gripper.run.problem import GraspSetup
from graspsense_sim_gripper.run.sampled_loop import instability
from graspsense_sim_gripper.scene.library import split_number


@define(eq=False)
class SelectedScene:
    """A scene of a job with its steps, which all seeds share. The instances with a number are one scene."""

    job: Job
    problem: Problem
    chosen: ChosenSteps | None
    """None: there is no object."""

    def setup(self, seed: int, number: int | None) -> GraspSetup:
        """Return the grasp with this seed; `number`: that of a particular instance. Raises as `instantiate` does."""
        problem = self.problem
        if problem.number != number:
            problem = evolve(problem, number=number)
        return instantiate(problem, self.chosen, seed)

    @cached_property
    def example(self) -> GraspSetup:
        """Any of its grasps, for what all of them have in common."""
        return instantiate(self.problem, self.chosen, None)

    @cached_property
    def composition(self) -> Composition:
        """That of its compiled grasps."""
        return composition_of(self.example)

    @cached_property
    def drawn(self) -> DrawnScene:
        """What its compiled grasps are drawn from."""
        return drawn_scene(self.problem, self.example, started(self.job, padded(self.example)))

    @cached_property
    def model(self) -> GraspModel:
        """The model of its object, for the reports of its grasps."""
        if self.problem.spec is None or self.chosen is None:
            return GraspModel((), None, "")
        unstable = instability(self.example, self.job.grasp_controller, self.chosen)
        return GraspModel(self.problem.spec.kinds, self.chosen, unstable)


@define(eq=False)
class Scenes:
    """The scenes of a job."""

    job: Job
    selected: Mapping[tuple[str, bool], ChosenSteps | None] = field(factory=dict)
    """Models that were selected elsewhere, by `scene_key`."""
    _scenes: dict[tuple[str, bool], SelectedScene] = field(factory=dict, init=False)
    """By `scene_key`."""

    def add(self, name: str, *, compiled: bool = False) -> SelectedScene:
        """Select the model of a scene. `compiled`: run the trial grasps compiled, not in the interpreter.

        Raises UnknownName and ConfigError as `build` and `select` do.
        """
        job, key = self.job, scene_key(name)
        chosen = self.selected.get(key)
        problem = build(job.config, name)
        if problem.spec is not None and chosen is None:
            chosen = select(problem, job.grasp_controller, compiled=compiled)
        self._scenes[key] = SelectedScene(job, problem, chosen)
        return self._scenes[key]

    def find(self, name: str) -> SelectedScene:
        """Return a scene. Its model is selected if it was not added before. Raises as `add` does."""
        return self._scenes.get(scene_key(name)) or self.add(name)

    def setup(self, name: str, seed: int) -> GraspSetup:
        """Return the grasp of a scene with this seed. Raises as `add` and `instantiate` do."""
        return self.find(name).setup(seed, number_in(name))

    def models(self) -> dict[tuple[str, bool], ChosenSteps | None]:
        """Return the models of the scenes that were added, by `scene_key`."""
        return {key: scene.chosen for key, scene in self._scenes.items()}


@lru_cache(maxsize=4096)
def scene_key(name: str) -> tuple[str, bool]:
    """Return the key of a scene's model: the name without the number of an instance, and whether there is a number."""
    return split_number(name)[0], number_in(name) is not None


@lru_cache(maxsize=4096)
def number_in(name: str) -> int | None:
    """Return the number of an instance that the name of a scene ends with; None if there is none."""
    return split_number(name)[1]
