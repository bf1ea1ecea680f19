"""The controller of simulated grasps, and one grasp before it begins."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import Controller, FeatureSet
from graspsense.simulator_api import RunConfig, TickParams, TickState
from graspsense_sim_gripper.plant.sensing import SensorParams, SensorState
from graspsense_sim_gripper.run.drawing import image_noise
from graspsense_sim_gripper.run.loop import NOT_STARTED, GraspParams, SimulationState
from graspsense_sim_gripper.scene.random_numbers import key_of
from graspsense_sim_gripper.scene.spec import TermParams
from graspsense_sim_gripper.solve.scheme import PlantParams, PlantState

IMAGES_PER_BLOCK: Final = 64
"""Number of cell images whose noise is drawn at once where it is not known how many a grasp needs."""

ControllerStep = Callable[..., Any]
"""The step of a controller, with parameters and state of its own types."""


@frozen(eq=False)
class GraspController:
    """A controller with the settings of its runs, and the feature set that is to follow."""

    controller: Controller[Any]
    run: RunConfig
    features: FeatureSet[Any] | None = None
    """The feature set that extracts from the grasps; its features are verified too. None: those of the paper only."""

    @property
    def step(self) -> ControllerStep:
        """The step function of the controller's class."""
        return type(self.controller).step

    @cached_property
    def content(self) -> str:
        """All of the controller, besides its step, that a grasp depends on, as text: NaN is not equal to itself.

        Whether it declares free motion is part of it: an approach of steps over several ticks changes the force that
        the trial grasps measure by some 1e-8 of it.
        """
        law, run = self.controller, self.run
        return repr((law.params(), law.init(), law.free_motion is not None, run.hold_s, run.grasp_timeout_s))


@frozen(kw_only=True)
class GraspSetup:
    """One grasp before it begins: parameters and initial states of plant and sensors, and the seed."""

    kinds: tuple[str, ...]
    """The kinds of the object's terms."""
    terms: tuple[TermParams, ...]
    """Their parameters."""
    plant: PlantParams
    state: PlantState
    sensor: SensorParams
    sensor_state: SensorState
    dt_s: float
    seed: int

    def begun(
        self, controller: TickParams, initial: TickState, max_ticks: int
    ) -> tuple[GraspParams, SimulationState]:
        """Return the parameters of the loop for this grasp, and the state in which it begins."""
        params = GraspParams(
            plant=self.plant,
            sensor=self.sensor,
            controller=controller,
            dt_s=self.dt_s,
            max_ticks=max_ticks,
            macro_steps=1 if self.plant.steps.macro_tolerance > 0.0 else 0,
        )
        return params, SimulationState(NOT_STARTED, self.state, self.sensor_state, initial)

    def noise(self, begin: int, count: int) -> NDArray[np.float64]:
        """Return the noise of the cell images from image `begin` on: normal numbers (count, 2 CELLS)."""
        return image_noise(key_of(self.seed), begin, count)
