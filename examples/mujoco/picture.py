"""A picture of a gripper that holds the egg, by MuJoCo's renderer."""

from __future__ import annotations

from math import inf
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

from graspsense.plugin_api import VELOCITY, Command, create

WIDTH, HEIGHT = 200, 160
SPEED_M_S = 0.02


def write_picture(file: Path, target: Path, force_n: float) -> None:
    """Close a gripper on the egg and write its picture. Needs EGL or OSMesa (MUJOCO_GL)."""
    gripper = create("sensor-backend", "mujoco", file=str(file), object="egg", spread=False)
    gripper.open(0)
    steady = 0
    while steady < 500:
        reading = gripper.read(0.1)
        gripper.apply(Command(VELOCITY, -SPEED_M_S, force_n, inf))
        steady = steady + 1 if min(reading.frame.force_left_n, reading.frame.force_right_n) > 1.0 else 0
    model, data = gripper._model, gripper._data
    model.vis.headlight.ambient[:] = 0.5
    scene = mujoco.MjvOption()
    # Visual geoms of these models are in group 1 or 2; things, and the geoms of other fingers, in group 0.
    scene.geomgroup[:] = (1, 1, 1, 0, 0, 0)
    scene.sitegroup[:] = 0
    camera = mujoco.MjvCamera()
    camera.lookat[:] = gripper._travel.place
    camera.distance, camera.elevation = 0.45, -15.0
    axis = gripper._travel.axis
    camera.azimuth = float(np.degrees(np.arctan2(axis[1], axis[0]))) + 90.0
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera, scene)
        image = Image.fromarray(renderer.render())
    target.parent.mkdir(parents=True, exist_ok=True)
    image.quantize(48).save(target, optimize=True)
    gripper.close()
