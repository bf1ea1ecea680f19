"""The roughness of a thing, which the cells of a pad feel when it slides past them.

A cell on a spring that presses on a surface of height h is compressed by h more, so h is added to the rest position of
its spring. This is exact for a pad of separate springs on a rigid surface whose heights are small.
"""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from graspsense_mujoco_gripper.gripper_file import GripperFile
from graspsense_mujoco_gripper.model import identifier

WAVES: Final = 12
WAVELENGTH_M: Final = (0.0002, 0.002)
"""The heights are a sum of so many waves of random direction and phase, of lengths in this range."""


class Roughness:
    """Sets the springs of the cells by the height of the surface that each touches."""

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        gripper: GripperFile,
        thing: int,
        rms_m: float,
        generator: np.random.Generator,
    ) -> None:
        self._model, self._data, self._thing = model, data, thing
        joints = [
            identifier(model, "joint", name)
            for finger in (gripper.left, gripper.right)
            for name in finger.cells
        ]
        self._springs = model.jnt_qposadr[joints]
        self._bodies = model.jnt_bodyid[joints]
        sides = np.repeat([0, 1], [len(gripper.left.cells), len(gripper.right.cells)])
        length_m = np.exp(generator.uniform(np.log(WAVELENGTH_M[0]), np.log(WAVELENGTH_M[1]), (2, WAVES)))
        direction, phase = generator.uniform(0.0, 2.0 * np.pi, (2, 2, WAVES))
        wave = (
            2.0
            * np.pi
            / length_m
            * np.stack([np.zeros_like(direction), np.cos(direction), np.sin(direction)])
        )
        self._waves: NDArray[np.float64] = wave.transpose(1, 0, 2)[sides]
        self._phases: NDArray[np.float64] = phase[sides]
        self._height_m = rms_m * np.sqrt(2.0 / WAVES)

    def set(self) -> None:
        """Set the springs for the present place of the thing. A cell of a flat surface has the rest position 0."""
        data, body = self._data, self._thing
        apart = data.xpos[self._bodies] - data.xpos[body]
        place = apart @ data.xmat[body].reshape(3, 3)
        angles = np.einsum("kd,kdw->kw", place, self._waves) + self._phases
        self._model.qpos_spring[self._springs] = -self._height_m * np.cos(angles).sum(axis=1)
