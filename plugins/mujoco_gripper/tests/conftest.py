"""What the tests of grasps in MuJoCo share: a scene in a file, and a grasp of the default pipeline."""

import pytest

from graspsense import load_pipeline


@pytest.fixture
def scene_file(tmp_path):
    """Writes a scene of these lines; returns its path."""

    def write(*lines):
        (tmp_path / "scene.toml").write_text("\n".join(lines) + "\n")
        return str(tmp_path / "scene.toml")

    return write


@pytest.fixture(scope="session")
def grasped():
    """Grasps a thing without spread, closing fast."""

    def grasp(*options, thing="block"):
        usual = ("gripper.type=mujoco", "classifier.type=none", "gripper.spread=false")
        options = [*usual, "controller.closing_speed_m_s=0.1", *options]
        return load_pipeline("default", options=options).grasp(object=thing, seed=0)

    return grasp
