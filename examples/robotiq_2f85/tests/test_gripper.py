"""The example against the emulated gripper of graspsense-robotiq-2f."""

from __future__ import annotations

import pytest
from graspsense_robotiq_2f85.backend import crc

from graspsense import load_pipeline
from graspsense.plugin_api import POSITION, Command, DeviceLost, NoDevice, create
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.emulator.device import EmulatedGripper

PATIENT_S = 60.0


@pytest.fixture
def emulated():
    gripper = EmulatedGripper(RobotiqConfig(port="emulated"), "pty", 1)
    gripper.tell("plug")
    yield gripper
    gripper.close()


def pipeline(emulated):
    return load_pipeline(
        "robotiq",
        options=[
            "gripper.type=robotiq-2f85",
            f"gripper.port={emulated.where}",
            f"gripper.reply_timeout_s={PATIENT_S}",
        ],
    )


def test_a_grasp(emulated):
    trial = pipeline(emulated).grasp()
    assert trial.outcome.words == "steady", trial.reason
    assert 0.04 < trial.trace.gap_m.min() < 0.07
    assert not emulated.state()["going"]


def test_a_lost_gripper_is_told(emulated):
    gripper = create("sensor-backend", "robotiq-2f85", port=emulated.where, reply_timeout_s=PATIENT_S)
    gripper.open(0)
    gripper.read(1.0)
    gripper.apply(Command(POSITION, 0.0, 20.0, 0.02))
    gripper.read(1.0)
    assert emulated.state()["going"]
    emulated.tell("unplug")
    with pytest.raises(DeviceLost):
        gripper.read(1.0)
    gripper.close()


def test_no_gripper_is_said_with_what_to_look_at():
    with pytest.raises(NoDevice, match=r"gripper\.port"):
        create("sensor-backend", "robotiq-2f85", port="/dev/nowhere").open(0)


def test_the_checksum_is_that_of_the_manual():
    # "Activation request" of the manual: 09 10 03 E8 00 03 06 01 00 00 00 00 00, checksum 72 E1.
    assert crc(bytes.fromhex("09 10 03 e8 00 03 06 01 00 00 00 00 00")) == bytes.fromhex("72 e1")
