"""The motion of a scene while it is grasped: the arm, the cord, the shake, the table and the filling."""

from __future__ import annotations

from math import isfinite
from typing import Final

import mujoco
import numpy as np

from graspsense_mujoco_gripper.bump import Bumper
from graspsense_mujoco_gripper.scene import Floats, Scene, value_at
from graspsense_mujoco_gripper.world import ARM, SHAKE, TABLE, is_thing

AFTER_BUMP_S: Final = 0.5
"""For so long after a bump it is watched how far the thing comes down."""


class ArmMotion:
    """Moves the arm and pulls the cord, by the time since both fingers touched."""

    def __init__(self, model: mujoco.MjModel, scene: Scene, finger: int, edge: str) -> None:
        """`finger` is a geom of a finger, with which the height of the thing is compared; `edge` its edge sensor."""
        self._finger = finger
        self._scene, self._contact_s = scene, float("inf")
        names = [model.actuator(k).name for k in range(model.nu)]
        self._servos, self._shakers = (
            [k for k, name in enumerate(names) if name.startswith(f"{kind}/")] for kind in (ARM, SHAKE)
        )
        self._bodies = things = [k for k in range(model.nbody) if is_thing(model, k)]
        self._masses = model.body_mass[things]
        self._body = things[0] if things else -1
        self.moves = bool(things) and (scene.is_disturbed or bool(scene.table_height))
        self._bumper = Bumper(model, scene.bump, edge, self._body) if things and scene.bump else None
        cord = () if scene.cord is None else scene.cord.force
        schedules = (scene.arm, scene.table_height, scene.fill, cord)
        self._model = model
        self._empty_kg = float(model.body_mass[self._body]) if things else 0.0
        self._table_m = float(model.body(TABLE).pos[2]) if scene.table and things else 0.0
        ends_s = [rows[-1][0] for rows in schedules if rows]
        self._end_s = max([*ends_s, 0.0 if scene.shake is None else scene.shake.end_s])
        if scene.bump is not None:
            self._end_s = max(self._end_s, scene.bump.t_s + AFTER_BUMP_S)
        self._start_m: Floats = np.zeros(3)
        self._above_finger_m = 0.0
        self._highest_m, self._height_m, self._slip_m = 0.0, 0.0, 0.0
        self._ended = False

    def set(self, data: mujoco.MjData, t_s: float, *, touched: bool) -> None:
        """Set the servo of the arm and the force of the cord for the time after this tick."""
        if touched and not isfinite(self._contact_s):
            self._contact_s = t_s
            self._start_m = self._centre(data)
            self._above_finger_m = float(self._start_m[2] - data.geom_xpos[self._finger, 2])
        if self._ended or not isfinite(self._contact_s):
            return
        # The last tick may lie behind the end, where everything has its last value.
        since_s = min(t_s - self._contact_s, self._end_s)
        self._ended = since_s == self._end_s
        self._height_m = float((self._centre(data) - self._start_m)[2])
        self._highest_m = max(self._highest_m, self._height_m)
        above_m = float(self._centre(data)[2] - data.geom_xpos[self._finger, 2])
        self._slip_m = max(self._slip_m, self._above_finger_m - above_m)
        if self._servos:
            data.ctrl[self._servos] = value_at(self._scene.arm, since_s)
        if self._scene.shake is not None:
            data.ctrl[self._shakers] = self._scene.shake.place_m(since_s)
        if self._scene.cord is not None:
            data.xfrc_applied[self._body, :3] = self._scene.cord.pull_n(since_s)
        if self._bumper is not None:
            self._bumper.set(data, since_s)
        if self._scene.table_height:
            data.mocap_pos[0, 2] = self._table_m + value_at(self._scene.table_height, since_s)
        if self._scene.fill:
            self._fill(value_at(self._scene.fill, since_s))

    def shaken_m(self, data: mujoco.MjData) -> float:
        """Return how far the shake has displaced the gripper."""
        return float(data.actuator_length[self._shakers[0]])

    def _fill(self, filled_kg: float) -> None:
        """Give the thing this mass more, spread over its first body as its own."""
        model, body = self._model, self._body
        factor = (self._empty_kg + filled_kg) / float(model.body_mass[body])
        model.body_mass[body] *= factor
        model.body_inertia[body] *= factor

    def _centre(self, data: mujoco.MjData) -> Floats:
        """Return the centre of mass of the thing."""
        centre: Floats = self._masses @ data.xipos[self._bodies] / self._masses.sum()
        return centre

    def report(self) -> dict[str, float]:
        """Return how high above where it was touched the thing was lifted, and how high it was at the end (m).

        The end is that of the motion and the pull that the scene gives; the release comes after it. `slip_m` is how far
        the thing came down in the fingers by then.
        """
        return {"highest_m": self._highest_m, "height_m": self._height_m, "slip_m": self._slip_m}
