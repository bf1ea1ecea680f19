"""Files that a user names: a pipe or a device is refused at once, and a large file is not read whole."""

import os
from pathlib import Path

import pytest
from cases import every_case
from commands import graspsense, refused

from graspsense.core.files.whole_file import NotAFile, first_bytes
from graspsense.core.grasp.calibration_files import read_calibration
from graspsense.core.values.errors import ConfigError
from graspsense.sources.recordings.icub import read_grasp

ZERO = Path("/dev/zero")


@pytest.fixture
def pipe(tmp_path):
    """Return a pipe without a writer, whose reader would wait for ever."""
    path = tmp_path / "pipe.toml"
    os.mkfifo(path)
    return path


def test_a_pipe_is_no_file_and_no_more_is_read_than_asked(pipe, tmp_path):
    for read in (lambda path: first_bytes(path, 100), read_grasp, read_calibration):
        with pytest.raises((NotAFile, ConfigError), match="pipe"):
            read(pipe)
    path = tmp_path / "long"
    path.write_bytes(b"x" * 1000)
    assert len(first_bytes(path, 100)) == 101


@every_case(
    "command",
    [
        "import {} --check",
        "experiment {}",
        "config validate {}",
        "run --object {}",
        "run --pipeline {}",
        "predict {} {}",
        "import csv:{} --check --label can",
        "import csv:{}?time=t&gap=g&force=f --check --label can",
        "run -o gripper.type=replay -o gripper.recording=csv:{}",
    ],
)
def test_a_pipe_for_settings_a_scene_or_a_model_is_refused(pipe, command):
    done = graspsense(*command.replace("{}", str(pipe)).split())
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)


@pytest.mark.skipif(not ZERO.exists(), reason="needs /dev/zero")
def test_a_device_or_an_endless_file_as_a_model_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("GRASPSENSE_MAX_MODEL_BYTES", "1000000")
    (tmp_path / "zero.json").symlink_to(ZERO)
    with (tmp_path / "sparse.json").open("wb") as file:
        file.truncate(40 * 10**9)
    for name in ("zero.json", "sparse.json"):
        assert "model" in refused("run", "-o", f"classifier.model={tmp_path / name}")


def test_a_pipe_in_the_place_of_a_database_is_refused(tmp_path):
    (tmp_path / "st").mkdir()
    os.mkfifo(tmp_path / "st" / "store.sqlite")
    for command in ("recover", "verify"):
        assert graspsense(command, tmp_path / "st").returncode == 2


def test_a_scene_whose_instances_differ_without_bound_is_refused(tmp_path):
    scene = tmp_path / "s.toml"
    scene.write_text(
        'width_m = 0.06\nstiffness_spread = 1e10\n[[terms]]\ntype = "elastic"\nk1_n_m = 2000.0\n'
    )
    assert "stiffness_spread" in refused("run", "--object", scene)
