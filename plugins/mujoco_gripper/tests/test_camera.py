"""Pictures of a grasp without a screen: made where the libraries are, else refused before the grasp."""

import subprocess
import sys

import pytest
from cases import every_case
from PIL import Image

from graspsense.plugin_api import ConfigError, create
from graspsense_mujoco_gripper import camera


class Wish:
    """A viewer that keeps what it receives."""

    def __init__(self, frames_hz=0.0, *, window=False):
        self.frames_hz, self.window, self.images = frames_hz, window, []

    def picture(self, image):
        self.images.append(image)


@pytest.fixture
def gripper():
    backend = create("sensor-backend", "mujoco")
    yield backend
    backend.close()


@every_case(
    ("missing", "said"),
    [("OpenGL", "pip install.*pictures|pictures.*pip install"), ("library", "libegl1.*libosmesa6")],
)
def test_what_is_missing_for_pictures_is_told_before_the_grasp(monkeypatch, gripper, missing, said):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(camera, "find_spec", lambda name: None if missing == "OpenGL" else name)
    monkeypatch.setattr(camera, "find_library", lambda name: None)
    with pytest.raises(ConfigError, match=f"(?s){said}"):
        gripper.see(Wish(25.0))


def test_a_window_without_a_screen_is_refused(monkeypatch, gripper):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ConfigError, match=r"DISPLAY.*--video"):
        gripper.see(Wish(window=True))


def test_the_environment_names_the_library(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(camera, "find_spec", lambda name: name)
    monkeypatch.setattr(camera, "find_library", lambda name: f"lib{name}.so")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    assert camera.offscreen() == "egl"
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    assert camera.offscreen() == "osmesa"


@pytest.mark.slow
def test_a_picture_shows_the_gripper_or_the_command_says_what_is_missing(tmp_path):
    """Both ends are asserted; which one this machine has depends on its libraries."""
    path = tmp_path / "grasp.png"
    program = [sys.executable, "-m", "graspsense", "run", "--gripper", "mujoco", "--object", "block"]
    options = "-o classifier.type=none -o controller.sends=velocity -o controller.closing_speed_m_s=0.15"
    command = [*program, *options.split(), "--picture", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        with Image.open(path) as image:
            colours = image.convert("RGB").getcolors(640 * 480)
        assert len(colours) > 20  # a scene with light on it, not one colour
    else:
        assert done.returncode == 2
        assert "pictures" in done.stderr
        assert not path.exists()
