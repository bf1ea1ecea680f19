"""A gripper of one's own, with cells in counts, is calibrated by the same commands as ours."""

from __future__ import annotations

import sys

import pytest
from attrs import evolve, frozen
from cases import every_case
from commands import graspsense
from parts import CHANNELS_OF_HAND, Hand, HandConfig, channels, offering

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.gripper_api import (
    calibrations_of,
    cells_force,
    load_of,
    stored_gain,
    stored_tables,
    stored_zero,
)
from graspsense.plugin_api import NAMES_INPUT, SensorBackend, SensorBackendEntry, setting

HERE = sys.modules[__name__]
NUMBERS = {"pad_counts_per_n": 2200.0}
NO_MODEL = ("-o", "classifier.type=none")


@frozen(kw_only=True)
class CountingConfig(HandConfig):
    calibration: str = setting(default="", effect=NAMES_INPUT, meaning="Folder of calibrations.")


class Counting(Hand, SensorBackend[CountingConfig]):
    channels = channels(*CHANNELS_OF_HAND)
    accepts = ("effort",)

    def open(self, seed):
        return evolve(super().open(seed), serial="H7", numbers=NUMBERS)

    def read(self, timeout_s):
        return super().read(timeout_s)._replace(signals=())


class Stopped(Counting):
    """Its clock stands still."""

    def read(self, timeout_s):
        reading = super().read(timeout_s)
        return reading._replace(frame=reading.frame._replace(t_s=0.0, dt_s=0.0))


class Keyless(Hand):
    channels = Counting.channels
    accepts = ("effort",)


PLUGIN = offering(
    SensorBackendEntry("counting", f"{__name__}:Counting", "a hand"),
    SensorBackendEntry("stopped", f"{__name__}:Stopped", "a hand"),
    SensorBackendEntry("keyless", f"{__name__}:Keyless", "a hand", config="parts:HandConfig"),
)


@pytest.fixture
def calibrate(monkeypatch, tmp_path):
    """Return a function that calibrates a gripper in this folder, from readings with this text."""
    monkeypatch.setitem(sys.modules, __name__, HERE)

    def calibrate(kind, text=None, gripper="counting"):
        readings, folder = tmp_path / "readings.csv", f"gripper.calibration={tmp_path}"
        readings.write_text(text or "")
        given = [kind, *([] if text is None else [readings])]
        folder = [] if gripper == "keyless" else ["-o", folder]
        with IsolatedPlugins(PLUGIN):
            done = graspsense("calibrate", *given, *folder, "--gripper", gripper, *NO_MODEL)
        return done.returncode, done.stderr

    return calibrate


def test_zero_and_force_are_stored_and_found_by_serial_number(calibrate, tmp_path):
    assert calibrate("tare") == (0, "")
    rows = "left,2200,1.1\nleft,4400,2.2\nright,2200,1\nright,4400,2\n"
    assert calibrate("load-cell", "side,pad_counts,load_n\n" + rows)[0] == 0
    calibrations = calibrations_of(tmp_path, "H7", NUMBERS)
    left, right = stored_zero(calibrations["tare"])
    assert (len(left), set(left), set(right)) == (22, {3000.0}, {3000.0})
    left_table, _ = stored_tables(calibrations["load-cell"])
    assert load_of(left_table, 1.5) == (pytest.approx(1.65), True)


def gains_text(scale=1.0, cells=22, whole=""):
    rows = [
        f"{side},{cell}{whole},{scale * factor * (100 + cell) * load_n},{load_n}"
        for side, factor in (("left", 1.0), ("right", 2.0))
        for cell in range(cells)
        for load_n in (0.5, 2.0)
    ]
    return "\n".join(["side,cell,counts,load_n", *rows])


def test_the_gain_of_each_cell_is_fitted_stored_and_used(calibrate, tmp_path):
    assert calibrate("gain", gains_text()) == (0, "")
    left, right = stored_gain(calibrations_of(tmp_path, "H7", NUMBERS)["gain"])
    assert left == pytest.approx([100 + cell for cell in range(22)])
    assert right == pytest.approx([200 + 2 * cell for cell in range(22)])
    # Two cells of the face, each with 3 N on it, whatever their gains are.
    zero = (3000.0,) * 22
    pressed = tuple(3000.0 + 3.0 * left[i] if i in (8, 20) else 3000.0 for i in range(22))
    assert cells_force(pressed, zero, left, 7) == pytest.approx(6.0)


@every_case(
    ("text", "said"),
    [
        (gains_text(cells=21), "21"),
        (gains_text(cells=23), "no cell 22"),
        (gains_text(scale=-1.0), "do not rise"),
        (gains_text(whole=".5"), "whole number"),
        (gains_text().replace("cell", "taxel"), "columns cell"),
        (gains_text() + "\nleft,3,nan,1\n", "numbers"),
        (gains_text() + "\nmiddle,3,100,1\n", "left or right"),
    ],
)
def test_readings_that_give_no_gain_are_refused(calibrate, tmp_path, text, said):
    code, told = calibrate("gain", text)
    assert (code in (2, 5), said in told, (tmp_path / "H7").exists()) == (True, True, False), told


def test_a_gripper_without_the_setting_is_told_what_it_takes(calibrate):
    code, said = calibrate("tare", gripper="keyless")
    assert (code, "no key 'calibration'" in said, "calibrations_of" in said) == (2, True, True)


def test_a_clock_that_stands_still_ends_the_calibration(calibrate, tmp_path):
    """The time limits of its motions are those of this clock."""
    code, said = calibrate("tare", gripper="stopped")
    assert (code, "clock stands still" in said, (tmp_path / "H7").exists()) == (4, True, False), said
