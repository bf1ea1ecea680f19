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
    # Across the fingers: they point from their body to the thing.
    body = model.geom_bodyid[min(gripper._left.geoms)]
    across = np.cross(gripper._travel.axis, gripper._travel.place - data.xpos[body])
    across /= np.linalg.norm(across)
    camera.distance = 0.4
    camera.azimuth = float(np.degrees(np.arctan2(across[1], across[0])))
    camera.elevation = float(np.degrees(np.arcsin(across[2])))
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera, scene)
        pixels = renderer.render().copy()
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera, scene)
        pixels[renderer.render()[..., 0] < 0] = 255
    image = Image.fromarray(pixels)
    target.parent.mkdir(parents=True, exist_ok=True)
    image.quantize(48).save(target, optimize=True)
    gripper.close()
