"""`graspsense calibrate` and what its files do to a run: kept by serial, hashed, and refused where they do not fit."""

import json
import pwd

import pytest
from cases import every_case
from commands import graspsense, refused

from graspsense.core.grasp.calibration import load_of, load_table
from graspsense.core.grasp.calibration_files import (
    Calibration,
    calibration_path,
    read_calibration,
    write_calibration,
)
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import Pr2Config

GRIPPER = ("--gripper", "pr2", "-o", "gripper.transport=emulated", "--object", "can:empty_open", "--seed", "1",
           "-o", "gripper.body_config.open_gap_m=0.075", "-o", "classifier.type=none")  # fmt: skip


@pytest.fixture
def shell(tmp_path):
    """Run `graspsense`, with calibrations below this test's own folder; return exit code, JSON, stderr."""

    def call(command, *arguments):
        options = (*GRIPPER, "-o", f"gripper.calibration={tmp_path}", "--json")
        done = graspsense(*command.split(), *options, *arguments)
        return done.returncode, done.json, done.stderr

    return call


@pytest.mark.slow
def test_stored_tare_has_its_time_and_its_hash_stands_in_the_trial(shell, tmp_path):
    _, tare, _ = shell("calibrate tare", "--images", "12")
    stored = read_calibration(tmp_path / "EMULATED" / "tare.json")
    assert stored.made == tare["made"]
    assert stored.made.endswith("+00:00")
    assert (stored.data["images"], stored.device["pad_counts_per_n"]) == (12, 1600)
    code, trial, _ = shell("run")
    assert (code, trial["outcome"]) == (0, "steady")
    assert trial["device"]["calibration"] == {"tare": stored.sha256}


def test_calibration_of_another_linkage_is_an_error_with_two_choices(shell, tmp_path):
    shell("calibrate tare")
    other = ("-o", "gripper.transmission=pr2_paper")
    code, _, err = shell("run", *other)
    assert code == 2
    for said in (
        "transmission was 'pr2' and is 'pr2_paper'",
        "tare --replace",
        "-o gripper.calibration=none",
    ):
        assert said in err
    assert opened(transmission="pr2_paper", calibration="none").calibration == {}
    assert shell("calibrate tare", "--replace", *other)[0] == 0
    assert opened(transmission="pr2_paper", calibration=str(tmp_path)).calibration.keys() == {"tare"}


def opened(**settings):
    """Return what an emulated gripper with these settings says when it is opened."""
    backend = Pr2Backend(Pr2Config(transport="emulated", **settings))
    info = backend.open(0)
    backend.close()
    return info


def test_changed_file_and_that_of_another_serial_are_refused(shell, tmp_path):
    shell("calibrate tare", "-o", 'gripper.serial="R2"')
    path = (tmp_path / "R2").rename(tmp_path / "EMULATED") / "tare.json"
    code, _, err = shell("run")
    assert code == 2
    assert "serial was 'R2' and is 'EMULATED'" in err

    content = json.loads(path.read_text())
    content["data"]["left"][8] += 1.0
    path.write_text(json.dumps(content))
    assert shell("run")[0] == DataDamaged.exit_code


@pytest.mark.slow
def test_load_cell_table_changes_the_forces(shell, tmp_path):
    readings = tmp_path / "readings.csv"
    readings.write_text("side,pad_counts,load_n\n" + "".join(
        f"{side},{counts},{2.0 * counts / 1600.0}\n" for side in ("left", "right") for counts in (1600, 8000)
    ))  # fmt: skip
    _, plain, _ = shell("run")
    assert shell("calibrate load-cell", str(readings))[0] == 0
    contact = ("-o", "controller.contact_force_n=1.25", "-o", "features.contact_force_n=1.25")
    _, doubled, _ = shell("run", *contact)
    # The two grasps differ a little: how much effort an unclear contact allows follows from the contact force.
    assert doubled["features"]["f_steady"] == pytest.approx(2.0 * plain["features"]["f_steady"], rel=0.12)
    assert "load-cell" in doubled["device"]["calibration"]


@pytest.mark.slow
def test_friction_comes_out_near_the_models_own(shell):
    """Breakaway in the model is 8 N or its sliding friction, 7 N with a spread of 0.4 N, if that is more."""
    _, friction, _ = shell("calibrate friction", "--gaps", "2", "--narrowest", "0.07")
    efforts = (*friction["data"]["closing_n"], *friction["data"]["opening_n"])
    assert all(8.0 <= effort <= 8.5 for effort in efforts)


def test_gripper_without_calibrations_says_so():
    assert "keeps no calibrations" in refused("calibrate", "tare")


def test_without_a_home_a_calibration_is_refused_before_it_is_made(monkeypatch, tmp_path, shell):
    def unknown(uid):
        raise KeyError(f"getpwuid(): uid not found: {uid}")

    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.delenv("HOME", raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    err = refused("calibrate", "tare", "--images", "1000", *GRIPPER)
    assert "XDG_DATA_HOME" in err
    assert "gripper.calibration" in err
    assert shell("calibrate tare", "--images", "12")[0] == 0


def test_load_table_rises_and_goes_on_beyond_its_end():
    table = load_table([(1.0, 1.5), (2.0, 3.5), (2.0, 2.5), (4.0, 4.0), (5.0, 3.8)])
    assert table.load_n == pytest.approx((0.0, 1.5, 3.0, 3.9, 3.9)), "a mean of 2, and a fall pooled"
    assert load_of(table, 0.5) == (0.75, True)
    assert load_of(table, 3.0) == (pytest.approx(3.45), True)
    assert load_of(table, 6.0) == (pytest.approx(3.9), False)
    values = [load_of(table, 0.01 * i)[0] for i in range(-100, 700)]
    assert values == sorted(values)


@every_case("readings", [[], [(1.0, 1.0)], [(1.0, 1.0), (float("nan"), 2.0)], [(-1.0, 1.0), (2.0, 2.0)]])
def test_table_that_means_nothing_is_refused(readings):
    with pytest.raises(ConfigError):
        load_table(readings)


@every_case("text", ["", "[]", "{}", '{"format": "graspsense-calibration", "version": 2}', "\0"])
def test_what_is_no_calibration_is_damaged(text, tmp_path):
    path = tmp_path / "tare.json"
    path.write_text(text)
    with pytest.raises(DataDamaged, match=r"tare\.json"):
        read_calibration(path)


@every_case(("closing_n", "expected_n"), [((8.1, 9.4, 7.7), 9.4), ((), 7.0)])
def test_greatest_closing_effort_of_a_stored_friction_is_the_friction_of_the_drive(
    closing_n, expected_n, tmp_path
):
    """Opening takes more here, which is of no concern to a squeeze. An empty table is as good as none."""
    count, made = len(closing_n), "2026-11-26T12:00:00+00:00"
    data = {"gap_m": [0.08] * count, "closing_n": list(closing_n), "opening_n": [11.0] * count}
    numbers = opened(calibration=str(tmp_path)).numbers
    friction = Calibration(kind="friction", serial="EMULATED", device=numbers, made=made, data=data)
    write_calibration(calibration_path(tmp_path, "EMULATED", "friction"), friction)
    info = opened(calibration=str(tmp_path))
    assert (info.calibration.keys(), info.friction_n) == ({"friction"}, expected_n)
