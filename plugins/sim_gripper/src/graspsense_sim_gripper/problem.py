"""What is simulated: an object in the gripper, the controller that grasps it, and one grasp before it begins."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import CELLS, Controller, DeviceInfo, RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.dynamics.state import PlantState
from graspsense_sim_gripper.objects.spec import ObjectSpec, TermParams
from graspsense_sim_gripper.sensing import SensorParams, SensorState
from graspsense_sim_gripper.stepping.scheme import PlantParams

IMAGES_PER_BLOCK: Final = 64

ControllerStep = Callable[..., Any]
"""The step of a controller, with parameters and state of its own types."""


@frozen(eq=False)
class GraspController:
    """A controller with the settings of its runs."""

    controller: Controller[Any]
    run: RunConfig

    @property
    def step(self) -> ControllerStep:
        """The controller's step."""
        return type(self.controller).step

    @cached_property
    def content(self) -> str:
        """All numbers that a grasp under this controller depends on, as text, since NaN is not equal to itself."""
        law = self.controller
        return repr((law.params(), law.init(), self.run.hold_s, self.run.grasp_timeout_s))


@frozen(kw_only=True)
class GraspSetup:
    """One grasp before it begins: parameters and initial states of plant and sensors, and the rest of the seed."""

    kinds: tuple[str, ...]
    """The kinds of the object's terms."""
    terms: tuple[TermParams, ...]
    """Their parameters, whether the model keeps them or not."""
    plant: PlantParams
    state: PlantState
    sensor: SensorParams
    sensor_state: SensorState
    dt_s: float
    rng: np.random.Generator
    """The seed's generator after all of the above was drawn. It is not advanced any more."""

    def noise(self) -> Iterator[NDArray[np.float64]]:
        """Yield blocks of rows of 44 standard normal numbers, a row an image; the same at every call."""
        # As a copy of the generator would, in a quarter of the time.
        rng = np.random.default_rng(0)
        rng.bit_generator.state = self.rng.bit_generator.state
        while True:
            yield rng.standard_normal((IMAGES_PER_BLOCK, 2 * CELLS))


@frozen(kw_only=True)
class Problem:
    """An object in the gripper, before a seed draws an instance of it."""

    config: SimConfig
    spec: ObjectSpec | None
    """None: there is no object."""
    number: int | None
    """The number of a particular instance."""
    model_config: SimConfig
    """The config as far as a reduced model depends on it: with ideal sensors. It has spread where the instance is
    numbered, since that differs from the nominal object too."""
    device: DeviceInfo
    """How the gripper with ideal sensors presents itself to a controller."""
    nominal: GraspSetup | None
    """The grasp of the nominal object with all its terms, by `model_config`; None where there is no object."""
