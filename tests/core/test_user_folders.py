"""The user's own folders, and what a user does without who has no home directory."""

import os
import pwd
from pathlib import Path

import pytest
from commands import python

from graspsense.core.components.registry.discovery import disabled_in_config, write_disabled
from graspsense.core.files.user_folders import cache_folder, config_folder, data_folder
from graspsense.core.grasp.calibration_files import calibration_path, calibrations_of
from graspsense.core.values.errors import ConfigError

VARIABLES = ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR")
STRANGER = """
import pwd, sys
pwd.getpwuid = {}.__getitem__
from graspsense.cli.main import main
main(sys.argv[1:])
"""
"""The command line for a user of whom the system has no entry."""


@pytest.fixture
def homeless(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)  # of a user without an entry: KeyError


def test_folders_are_where_the_variables_say_and_else_in_the_home(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/home/ada")
    homes = ("/home/ada/.config", "/home/ada/.local/share", "/home/ada/.cache")
    for chosen in (homes, ("/c", "/d", "/e")):
        assert (config_folder(), data_folder(), cache_folder()) == tuple(
            Path(h) / "graspsense" for h in chosen
        )
        for name, folder in zip(VARIABLES[1:4], ("/c", "/d", "/e"), strict=True):
            monkeypatch.setenv(name, folder)
    # In a folder of somebody else's data, a relative one would name a part of that data.
    monkeypatch.setenv("XDG_CACHE_HOME", "e")
    assert cache_folder() == Path("/home/ada/.cache/graspsense")


@pytest.mark.usefixtures("homeless")
def test_without_a_home_nothing_is_disabled_calibrated_or_kept(tmp_path, monkeypatch):
    assert config_folder() is data_folder() is cache_folder() is None
    assert disabled_in_config() == ()
    assert calibrations_of("", "L7", {}) == {}
    with pytest.raises(ConfigError, match="set HOME or XDG_CONFIG_HOME"):
        write_disabled({"lab-peak"})
    with pytest.raises(ConfigError, match=r"set HOME or XDG_DATA_HOME.*gripper\.calibration"):
        calibration_path("", "L7", "tare")
    assert calibration_path(tmp_path, "L7", "tare") == tmp_path / "L7" / "tare.json"
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    write_disabled({"lab-peak"})
    assert disabled_in_config() == ("lab-peak",)


@pytest.mark.slow
def test_commands_work_without_a_home_and_leave_nothing_behind(tmp_path):
    """They run as a stranger without a home who stands in this folder."""
    scratch = tmp_path / "tmp"
    scratch.mkdir()
    kept = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    environ = {**kept, "NO_COLOR": "1", "TMPDIR": str(scratch)}
    done = python("-c", STRANGER, "plugins", "list", env=environ, cwd=tmp_path, check=True)
    assert "binary decision tree" in done.stdout
    assert list(tmp_path.rglob("*")) == [scratch]
