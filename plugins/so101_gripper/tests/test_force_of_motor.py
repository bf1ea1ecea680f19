"""From a load cell to the force of the gripper: calibrated on the command line, then tried on other loads."""

import pytest
from cases import every_case
from commands import graspsense

from graspsense.plugin_api import POSITION, Command, create
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.emulator.motor import CLOSED, GripperMotor
from graspsense_so101_gripper.jaw import Jaw
from graspsense_so101_gripper.registers import FULL_LOAD, STATE, MotorRequest

LIMITS = [190, 300, 260, 420, 350, 500, 440, 320, 250, 380, 470, 330, 210, 290, 390, 460, 340, 240, 490, 310]
OPEN_M, CLOSED_M = 0.064, 0.0
"""Wider than the block of the simulator by some mm."""


def closed_on_a_block(limits):
    """Return load and force of the emulated motor at rest on a block, for squeezes with these torque limits.

    After every second squeeze the limit is lowered, and a second reading is taken: the friction of the gears holds.
    """
    motor, now_s, pairs = GripperMotor(So101Config(port="emulated"), 1), 0.0, []

    def goes(goal, limit, seconds):
        nonlocal now_s
        motor.write(STATE[0], MotorRequest(1, 50, goal, 0, 60, limit).written())
        for _ in range(round(seconds * 100)):
            now_s += 0.01
            motor.look(now_s)
        return motor.number("present_load") / FULL_LOAD, min(motor.fingers.forces_n)

    for i, limit in enumerate(limits):
        _, zero_n = goes(jaw_position(OPEN_M), FULL_LOAD, 3.0 if i == 0 else 1.0)
        held = [goes(jaw_position(CLOSED_M), limit, 1.5)]
        if i % 2:
            held.append(goes(jaw_position(CLOSED_M), limit * 2 // 3, 0.3))
        pairs += [(load, force_n - zero_n) for load, force_n in held]
    motor.fingers.close()
    return pairs


def jaw_position(gap_m):
    return Jaw(CLOSED, CLOSED + 1024, 0.1).position(gap_m)


def calibrated(tmp_path, rows):
    readings, kept = tmp_path / "readings.csv", tmp_path / "kept"
    readings.write_text("direction,motor,load_n\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
    kept.mkdir()
    options = ("-o", "gripper.port=emulated", "-o", f"gripper.calibration={kept}", "--json")
    return graspsense("calibrate", "load-cell", readings, "--gripper", "so101", *options)


@pytest.mark.slow
def test_the_estimated_force_holds_the_measured_one_within_its_error(tmp_path):
    # Gears without a thing between the jaws need up to 13 % of the load.
    free = [("closing", 0.10 + 0.01 * i, 0.0) for i in range(4)]
    closing = [*free, *(("closing", *pair) for pair in closed_on_a_block(LIMITS))]
    opening = [("opening", 0.05 * i, max(0.05 * i - 0.1, 0.0) * 20.0) for i in range(1, 13)]
    data = calibrated(tmp_path, closing + opening).json["data"]
    assert set(data) == {"closing", "opening"}
    assert data["closing"]["error_n"] > 0.0

    kept = str(tmp_path / "kept")
    driver = create("sensor-backend", "so101", port="emulated", calibration=kept)
    info = driver.open(1)
    assert list(info.calibration) == ["load-cell"]

    def goes(gap_m, force_n, seconds):
        for _ in range(round(seconds * 100)):
            reading = driver.read(1.0)
            driver.apply(Command(POSITION, gap_m, force_n, 0.01))
        return reading

    inside = []
    for squeeze in range(12):
        goes(OPEN_M, 12.0, 3.0 if squeeze == 0 else 1.0)
        zero_n = driver._emulated.arm.details()["force_n"]
        # Between the forces of the calibration, and twice less than moves the jaw.
        reading = goes(CLOSED_M, 0.5 if squeeze > 9 else 2.5 + 0.12 * (squeeze * 3 % 10), 1.5)
        true_n = driver._emulated.arm.details()["force_n"] - zero_n
        inside.append(abs(reading.frame.effort_n - true_n) <= reading.signals.effort_error)
    driver.close()
    # Nine of ten, of twelve.
    assert sum(inside) >= 9


@every_case(
    ("rows", "words"),
    [
        ([("closing", 0.1 * i, i) for i in range(9)], "0 readings"),
        ([("left", 0.1, 1.0)], "closing or opening"),
        ([("closing", "x", 1.0)], "not a number"),
        ([(d, -0.1 * i, i) for d in ("closing", "opening") for i in range(10)], "0 N or more"),
    ],
)
def test_unfit_readings_are_told_and_nothing_is_kept(tmp_path, rows, words):
    done = calibrated(tmp_path, rows)
    assert done.returncode in (2, 5)
    assert words in done.stderr
    assert list((tmp_path / "kept").iterdir()) == []
