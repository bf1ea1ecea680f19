"""Pictures of a MuJoCo model without a screen (EGL or OSMesa), and MuJoCo's own window."""

from __future__ import annotations

import os
import sys
from ctypes.util import find_library
from importlib.util import find_spec
from time import perf_counter, sleep
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError

WIDTH, HEIGHT = 640, 480
LIBRARIES: Final = {"egl": "EGL", "osmesa": "OSMesa"}
DISTANCE: Final = 4.0
"""Of the camera, in openings of the gripper."""
NEAREST_M: Final = 0.25
WINDOW_HZ: Final = 60.0


def offscreen() -> str:
    """Return how pictures are made: `egl` or `osmesa`, or what MUJOCO_GL names of them. Raises ConfigError."""
    if sys.platform != "linux":
        return "native"
    if find_spec("OpenGL") is None:
        raise ConfigError(
            "pictures of MuJoCo need PyOpenGL: pip install 'graspsense-mujoco-gripper[pictures]'"
        )
    named = os.environ.get("MUJOCO_GL", "").lower()
    for way in (named,) if named in LIBRARIES else LIBRARIES:
        if find_library(LIBRARIES[way]) is not None:
            return way
    raise ConfigError(
        "pictures of MuJoCo need EGL or OSMesa, and neither library is here: apt-get install libegl1 (with a driver, "
        "as in libgl1-mesa-dri) or libosmesa6"
    )


def _context() -> Any:
    """Return a context of OpenGL without a screen. Raises ConfigError."""
    way = offscreen()
    try:
        if way == "native":
            from mujoco.gl_context import GLContext
        else:
            os.environ.setdefault("PYOPENGL_PLATFORM", way)
            if way == "egl":
                from mujoco.egl import GLContext
            else:
                from mujoco.osmesa import GLContext
        context = GLContext(WIDTH, HEIGHT)
        context.make_current()
    except Exception as error:
        other = "osmesa" if way == "egl" else "egl"
        raise ConfigError(
            f"pictures cannot be made by {way}: {error}. Try the other way: MUJOCO_GL={other}"
        ) from error
    return context


class Camera:
    """Looks at the place of the thing, across the closing direction."""

    def __init__(
        self, model: mujoco.MjModel, place: NDArray[np.float64], axis: NDArray[np.float64], open_m: float
    ) -> None:
        """Raises ConfigError where no picture can be made."""
        self._context = _context()
        self._model = model
        self._camera, self._option = free_camera(place, axis, open_m), mujoco.MjvOption()
        self._option.sitegroup[:] = 0  # Marks of the model, not parts of it.
        self._scene = mujoco.MjvScene(model, maxgeom=5000)
        self._renderer = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._renderer)
        self._view = mujoco.MjrRect(0, 0, WIDTH, HEIGHT)

    def image(self, data: mujoco.MjData) -> NDArray[np.uint8]:
        """Return the picture of this moment: rows x columns x 3 values from 0 to 255."""
        kinds = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(self._model, data, self._option, None, self._camera, kinds, self._scene)
        mujoco.mjr_render(self._view, self._scene, self._renderer)
        pixels = np.empty((HEIGHT, WIDTH, 3), np.uint8)
        mujoco.mjr_readPixels(pixels, None, self._view, self._renderer)
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Release the context."""
        self._renderer.free()
        self._context.free()


def free_camera(place: NDArray[np.float64], axis: NDArray[np.float64], open_m: float) -> mujoco.MjvCamera:
    """Return a camera that looks at this place, across the closing direction and from a little above."""
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    camera.lookat = place
    camera.distance = max(DISTANCE * open_m, NEAREST_M)
    camera.azimuth = float(np.degrees(np.arctan2(axis[1], axis[0]))) + 70.0
    camera.elevation = -20.0
    return camera


def require_screen() -> None:
    """Raise ConfigError where no window can be opened."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise ConfigError(
            "MuJoCo's viewer needs a screen, and neither DISPLAY nor WAYLAND_DISPLAY is set: use --video instead"
        )
    if find_spec("glfw") is None:
        raise ConfigError("MuJoCo's viewer needs glfw: pip install 'graspsense-mujoco-gripper[pictures]'")


class Window:
    """MuJoCo's own viewer, which follows the grasp in real time."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, view: mujoco.MjvCamera) -> None:
        from mujoco import viewer

        self._handle = viewer.launch_passive(model, data)
        with self._handle.lock():
            own = self._handle.cam
            own.lookat, own.distance = view.lookat, view.distance
            own.azimuth, own.elevation = view.azimuth, view.elevation
        self._began, self._next_s = perf_counter(), 0.0

    def follow(self, t_s: float) -> None:
        """Show the state, if it is time, and wait until the grasp is no faster than a clock."""
        if t_s < self._next_s:
            return
        self._next_s = t_s + 1.0 / WINDOW_HZ
        self._handle.sync()
        sleep(max(0.0, self._began + t_s - perf_counter()))

    def close(self) -> None:
        """Close the window."""
        self._handle.close()
