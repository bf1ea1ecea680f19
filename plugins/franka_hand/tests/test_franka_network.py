"""The driver through pylibfranka against the emulated hand on the network of this machine, in real time."""

import socket
import time
from contextlib import nullcontext
from threading import Thread

import pytest
from emulated_grippers import PATIENT_S, assert_a_killed_program_lets_go, plugged_in

from graspsense import load_pipeline
from graspsense.plugin_api import POSITION, Command, DeviceLost, NoDevice, create
from graspsense_franka_hand.config import FrankaConfig, FrankaFaults
from graspsense_franka_hand.discovery import diagnose, found_devices
from graspsense_franka_hand.emulator.device import EmulatedHand
from graspsense_franka_hand.protocol import PORT

pytest.importorskip("pylibfranka", reason="its wheels are for Linux on x86_64 and Python up to 3.12")

pytestmark = pytest.mark.slow

CLOSING = Command(POSITION, 0.0, 40.0, 0.02)
OPENING = Command(POSITION, 0.08, 40.0, 0.05)


@pytest.fixture
def emulated():
    with plugged_in(lambda **keys: EmulatedHand(FrankaConfig(host="emulated", **keys), 1)) as make:
        yield make


def _driver(hand):
    driver = create("sensor-backend", "franka", host=hand.where, calibration="none")
    driver.open(0)
    return driver


def _until(driver, command, condition):
    """Command this until a frame meets the condition."""
    until_s = time.monotonic() + PATIENT_S
    while not condition(reading := driver.read(PATIENT_S)):
        assert time.monotonic() < until_s, "the condition was never met"
        driver.apply(command)
    return reading


PHASES = {
    "closing": lambda driver: _until(driver, CLOSING, lambda reading: reading.frame.gap_m < 0.07),
    "holding": lambda driver: _until(driver, CLOSING, lambda reading: reading.signals.grasped == 1.0),
}


def test_a_grasp_with_pylibfranka(emulated):
    hand = emulated()
    # Held for longer than by default: a busy machine misses states, and a rest shows in three of them.
    patient = (f"run.frame_timeout_s={PATIENT_S / 10}", "run.hold_s=3.0")
    options = [f"gripper.host={hand.where}", "gripper.calibration=none", *patient]
    trial = load_pipeline("franka", options=options).grasp()

    assert trial.outcome.words == "steady", trial.reason
    assert 0.04 < trial.features["p_steady"] < trial.features["p_first"] < 0.05
    assert hand.state()["width_m"] > 0.078
    assert not hand.state()["pressing"]


@pytest.mark.parametrize("phase", ["closing", "holding"])
@pytest.mark.parametrize("mood", ["silent", "damaged", "late", "killed"])
def test_whatever_becomes_of_its_messages_the_hand_is_told_to_stop(emulated, mood, phase):
    """The hand still hears: what it is told last is to stop, also if the process of pylibfranka is killed."""
    hand = emulated(faults=FrankaFaults(late_s=0.05))
    driver = _driver(hand)
    PHASES[phase](driver)
    assert hand.state()["pressing"]
    driver._link._process.kill() if mood == "killed" else hand.tell(mood)
    with nullcontext() if mood == "late" else pytest.raises(DeviceLost, match=hand.where):
        [driver.read(PATIENT_S) for _ in range(20)]
    driver.close()
    until_s = time.monotonic() + (PATIENT_S if mood == "killed" else 0.0)
    while hand.state()["pressing"]:
        assert time.monotonic() < until_s, "it still presses"


@pytest.mark.parametrize("phase", PHASES)
def test_a_hand_that_is_unplugged_is_lost(emulated, phase):
    hand = emulated()
    driver = _driver(hand)
    PHASES[phase](driver)
    hand.tell("unplug")
    with pytest.raises(DeviceLost):
        [driver.read(PATIENT_S) for _ in range(20)]
    began_s = time.monotonic()
    driver.close()
    assert time.monotonic() - began_s < PATIENT_S


def test_the_running_grasp_is_given_up_for_an_opening(emulated):
    hand = emulated()
    driver = _driver(hand)
    PHASES["closing"](driver)
    reading = _until(driver, OPENING, lambda reading: reading.frame.gap_m > 0.078)
    assert reading.signals.grasped == 0.0
    driver.close()


def test_a_second_host_does_not_get_the_hand_and_the_first_keeps_it(emulated):
    hand = emulated()
    driver = _driver(hand)
    PHASES["closing"](driver)
    with pytest.raises(NoDevice, match="another program"):
        _driver(hand)
    PHASES["holding"](driver)
    driver.close()
    assert not hand.state()["pressing"]
    _driver(hand).close()


def test_doctor_tells_a_hand_from_none_and_lets_it_hold_on(emulated):
    hand = emulated()
    driver = _driver(hand)
    PHASES["holding"](driver)
    driver._link._ordered = False  # so that nobody tells it to stop
    driver._link._process.kill()
    driver.close()
    # The forks of the one that was killed let go of the hand at the next state.
    until_s, state = time.monotonic() + PATIENT_S, ""
    while state != "ok" and time.monotonic() < until_s:
        [finding] = diagnose(FrankaConfig(host=hand.where), PATIENT_S)
        state = finding.state
    assert state == "ok"
    assert finding.numbers["width_m"] == pytest.approx(hand.hand.width_m, abs=1e-4)
    assert hand.state()["pressing"]
    [finding] = diagnose(FrankaConfig(host="127.0.0.77"), PATIENT_S)
    assert finding.state == "problem"


def test_a_hand_that_answers_is_listed_and_goes_on(emulated):
    hand = emulated()
    driver = _driver(hand)
    PHASES["holding"](driver)
    # The program that has it is not disturbed.
    assert list(found_devices(PATIENT_S, hand.where)) == []
    assert driver.read(PATIENT_S).frame.gap_m > 0.0
    driver.close()
    earlier = hand.state()
    [device] = found_devices(PATIENT_S, hand.where)
    assert (device.backend, device.where, device.ready) == ("franka", hand.where, True)
    assert hand.state()["pressing"] == earlier["pressing"]


def test_another_version_is_no_device_and_listed_as_not_ready_and_another_device_is_not(emulated):
    hand = emulated(faults=FrankaFaults(mood="old"))
    with pytest.raises(NoDevice, match=r"[Vv]ersion"):
        _driver(hand)
    [device] = found_devices(PATIENT_S, hand.where)
    assert not device.ready
    assert "version" in device.advice
    with socket.create_server(("127.0.0.77", PORT)) as other:

        def answer():
            with other.accept()[0] as host:
                host.sendall(b"SSH-2.0-other")

        answers = Thread(target=answer)
        answers.start()
        assert list(found_devices(PATIENT_S, "127.0.0.77")) == []
        answers.join()
    assert list(found_devices(1.0, "127.0.0.77")) == []


def test_a_program_that_is_killed_leaves_no_hand_that_presses(emulated):
    hand = emulated()
    settings = {"host": hand.where, "calibration": "none", "told": "reading.signals.grasped"}
    assert_a_killed_program_lets_go("franka", lambda: hand.state()["pressing"], 40.0, **settings)
