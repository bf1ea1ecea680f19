"""LeRobot's Feetech bus drives the emulated arm at this port, and its table of registers is that of the driver.

    python arm.py PORT REGISTERS

REGISTERS is a JSON file: name, address, size and sign bit of each register of the driver. It runs in an environment
without graspsense, with the package `lerobot.motors` alone.
"""

from __future__ import annotations

import json
import sys
import time
import types
from pathlib import Path

# Its keyboard helpers import torch; no key is pressed here.
keyboard = types.ModuleType("lerobot.utils.utils")
keyboard.enter_pressed = keyboard.move_cursor_up = None
sys.modules[keyboard.__name__] = keyboard

from lerobot.motors import Motor, MotorCalibration, MotorNormMode  # noqa: E402
from lerobot.motors.feetech import FeetechMotorsBus, OperatingMode  # noqa: E402
from lerobot.motors.feetech.tables import MODEL_CONTROL_TABLE, MODEL_ENCODING_TABLE, MODEL_NUMBER_TABLE  # noqa: E402

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
DEADLINE_S = 30.0


def compare_registers(path: Path) -> int:
    table = {name.strip().lower(): place for name, place in MODEL_CONTROL_TABLE["sts3215"].items()}
    signs = {name.lower(): bit for name, bit in MODEL_ENCODING_TABLE["sts3215"].items()}
    registers = json.loads(path.read_text())
    for name, address, size, sign_bit in registers:
        assert table[name] == (address, size), (name, table[name], address, size)
        assert signs.get(name) == sign_bit, (name, signs.get(name), sign_bit)
    assert MODEL_NUMBER_TABLE["sts3215"] == 777
    return len(registers)


def until(bus: FeetechMotorsBus, done: str, wanted: int) -> None:
    end = time.monotonic() + DEADLINE_S
    while bus.read(done, "gripper", normalize=False) != wanted:
        assert time.monotonic() < end, f"{done} is not {wanted} after {DEADLINE_S} s"


def drive(port: str) -> None:
    motors = {
        name: Motor(
            number,
            "sts3215",
            MotorNormMode.RANGE_0_100 if name == "gripper" else MotorNormMode.RANGE_M100_100,
        )
        for number, name in enumerate(NAMES, 1)
    }
    bus = FeetechMotorsBus(port, motors)
    # It waits 50 ms for a reply, which a busy machine can exceed.
    bus.port_handler.setPacketTimeout = lambda length: bus.port_handler.setPacketTimeoutMillis(
        1e3 * DEADLINE_S
    )
    # The handshake finds every motor, with its model and firmware.
    bus.connect()
    assert bus.broadcast_ping() == dict.fromkeys(range(1, 7), 777)
    calibration = bus.read_calibration()
    assert calibration["gripper"].homing_offset == -120, calibration["gripper"]
    bus.calibration = calibration
    assert bus.is_calibrated
    with bus.torque_disabled():
        bus.configure_motors()
        for name in motors:
            bus.write("Operating_Mode", name, OperatingMode.POSITION.value)
            bus.write("P_Coefficient", name, 16)
        bus.write("Max_Torque_Limit", "gripper", 500)
        bus.write("Torque_Limit", "gripper", 300)
    positions = bus.sync_read("Present_Position")
    assert abs(positions["gripper"] - 100.0) < 1.0, positions
    bus.sync_write("Goal_Position", {name: 10.0 if name != "gripper" else 0.0 for name in NAMES})
    time.sleep(0.3)
    until(bus, "Moving", 0)
    load, position = (
        bus.read("Present_Load", "gripper", normalize=False),
        bus.read("Present_Position", "gripper"),
    )
    # It holds the thing, and pushes to close: a positive load, at the torque limit.
    assert load == 300, load
    assert 20.0 < position < 90.0, position
    assert abs(bus.read("Present_Position", "elbow_flex") - 10.0) < 0.1
    bus.write("Goal_Position", "gripper", 100.0)
    time.sleep(0.2)
    until(bus, "Moving", 0)
    assert bus.read("Present_Position", "gripper") > 95.0
    assert bus.read("Present_Voltage", "gripper", normalize=False) == 74
    bus.write_calibration({"gripper": MotorCalibration(6, 0, 33, 1500, 2500)}, cache=False)
    assert bus.read_calibration()["gripper"] == MotorCalibration(6, 0, 33, 1500, 2500)
    bus.disconnect()


compared = compare_registers(Path(sys.argv[2]))
drive(sys.argv[1])
print(f"judges: LeRobot's Feetech bus drives the emulated arm; {compared} registers are those of its table")  # noqa: T201
