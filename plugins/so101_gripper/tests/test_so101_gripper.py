"""The driver of the gripper's motor against the emulated arm."""

import json
import time
from contextlib import nullcontext

import pytest
from cases import every_case
from emulated_grippers import (
    PATIENT_S,
    assert_a_killed_program_lets_go,
    assert_lost_in_a_grasp,
    give_own_time,
    plugged_in,
)

from graspsense import WiringError, load_pipeline
from graspsense.core.drivers import serial_converters
from graspsense.plugin_api import (
    POSITION,
    VELOCITY,
    Command,
    ConfigError,
    DataDamaged,
    DeviceLost,
    NoDevice,
    create,
)
from graspsense.testing_api import parametrize_checks
from graspsense_so101_gripper import backend
from graspsense_so101_gripper.bus import ServoBus
from graspsense_so101_gripper.config import So101Config, So101Faults
from graspsense_so101_gripper.discovery import diagnose
from graspsense_so101_gripper.emulator.arm import EmulatedArm
from graspsense_so101_gripper.registers import STATE, MotorRequest, motor_state


@pytest.fixture
def own_time(monkeypatch):
    give_own_time(monkeypatch, backend)


@pytest.fixture
def emulated():
    with plugged_in(lambda **keys: EmulatedArm(So101Config(port="emulated", **keys), "pty", 1)) as make:
        yield make


def driver_of(arm, **keys):
    keys = {"port": arm.where, "reply_timeout_s": PATIENT_S, "calibration": "none", **keys}
    return create("sensor-backend", "so101", **keys)


def opened(arm, **keys):
    driver = driver_of(arm, **keys)
    driver.open(1)
    return driver


def states_of(arm):
    """Return the registers of each motor, as another host reads them."""
    bus = ServoBus(arm.where, PATIENT_S)
    states = {motor: bus.read(motor, *STATE) for motor in range(1, 7)}
    bus.close()
    return states


@pytest.mark.slow
@parametrize_checks(
    "graspsense-so101-gripper",
    wheel=False,  # .ci/grippers runs from the wheel
    # Every object is opened. That its steps are exact is a matter of the simulator, the body of the emulated arm.
    keys={"port": "emulated", "body_config": {"fidelity": "fixed"}},
    unplugged={"faults": {"unplug_at_s": 0.5}},
    absent={"port": "/dev/nowhere", "body_config": {}},
)
def test_conformance(check):
    check.run()


@pytest.mark.usefixtures("own_time")
def test_a_grasp_writes_to_no_other_motor_and_gives_the_gripper_back_as_it_was(emulated):
    arm = emulated()
    earlier = states_of(arm)
    options = [
        f"gripper.port={arm.where}",
        f"gripper.reply_timeout_s={PATIENT_S}",
        "gripper.calibration=none",
    ]
    trial = load_pipeline("so101", options=options).grasp()

    assert trial.outcome.words == "steady", trial.reason
    assert not trial.features.reasons
    # The jaw opens by 86 mm, and the block of the simulator is narrower.
    assert 0.05 < trial.features["p_steady"] <= trial.features["p_first"] < 0.08
    assert set(trial.trace.signals) == {channel.name for channel in backend.CHANNELS[3:]}
    assert arm.state()["written_to_others"] == 0
    after = states_of(arm)
    asked, given = (motor_state(states.pop(6)).asked for states in (after, earlier))
    assert after == earlier
    assert asked._replace(goal_position=0) == given._replace(goal_position=0)


@pytest.mark.usefixtures("own_time")
def test_a_frame_is_one_read(emulated):
    arm = emulated()
    driver = opened(arm)
    requests = arm.state()["requests"]
    frames = [driver.read(0.1).frame for _ in range(50)]
    assert arm.state()["requests"] - requests == 50
    assert 1.0 / 110.0 < (frames[-1].t_s - frames[0].t_s) / 49 < 1.0 / 99.0
    driver.close()


@pytest.mark.slow
@pytest.mark.usefixtures("own_time")
def test_it_closes_with_the_torque_limit_of_the_force_and_tells_load_current_and_supply(emulated):
    driver = opened(emulated(), jaw_length_m=0.1, stall_torque_nm=2.0)
    for _ in range(300):
        reading = driver.read(0.1)
        driver.apply(Command(POSITION, 0.0, 8.0, 0.05))
    driver.close()
    frame, signals = reading.frame, reading.signals
    # 2 N m at 0.1 m is 20 N, so that 8 N is 40 % of the load and of the 2.4 A.
    assert (signals.load, frame.effort_n) == pytest.approx((0.4, 8.0))
    # No load cell has measured it: it can be anything up to the full force.
    assert signals.effort_error == pytest.approx(20.0)
    assert signals.current == pytest.approx(0.4 * 2.4, abs=0.0065)
    assert (signals.motor_voltage, signals.motor_temperature) == pytest.approx((7.4, 303.15))
    assert 0.005 < frame.gap_m < 0.08


@pytest.mark.slow
@every_case("at_s", [0.02, 0.5, 2.0])
@every_case("fault", ["unplug", "silent"])
def test_a_gripper_lost_in_a_grasp_ends_it_and_is_told(fault, at_s):
    assert_lost_in_a_grasp("so101", fault, at_s)


@pytest.mark.slow
@every_case(
    ("mood", "late_s", "outcome"),
    [("damaged", 0.3, "device lost"), ("late", 0.3, "device lost"), ("late", 0.005, "steady")],
)
def test_the_emulated_gripper_without_a_port_has_the_faults_of_the_line(mood, late_s, outcome):
    faults = {"mood": mood, "mood_at_s": 0.5, "late_s": late_s}
    options = [f"gripper.faults.{key}={value}" for key, value in faults.items()]
    trial = load_pipeline("so101", options=["gripper.port=emulated", *options]).grasp()
    assert trial.outcome.words == outcome, trial.reason


@pytest.mark.usefixtures("own_time")
@pytest.mark.parametrize("mood", ["damaged", "silent", "late", "repeated"])
def test_whatever_becomes_of_replies_the_jaw_is_told_to_stop(emulated, mood):
    """The motor still hears: what it is told last is to stay where it is, without torque, as it was found."""
    arm = emulated(faults=So101Faults(late_s=0.01))
    driver = opened(arm)
    for _ in range(20):
        driver.read(0.1)
        driver.apply(Command(VELOCITY, -0.03, 8.0, 0.15))
    assert arm.state()["torque"]
    assert arm.state()["steps_to_go"] > 100
    arm.tell(mood)
    lost = mood in ("damaged", "silent")
    if lost:
        # No valid reply comes any more, so it need not be waited for.
        driver._bus.close()
        driver._bus = ServoBus(arm.where, 0.02)
    with pytest.raises(DeviceLost) if lost else nullcontext():
        [driver.read(0.1) for _ in range(4)]
    driver.close()
    assert not arm.state()["torque"]
    assert arm.state()["written_to_others"] == 0


@pytest.mark.usefixtures("own_time")
@every_case(("word", "why"), [("takeover", "another program"), ("restart", "power")])
def test_a_motor_that_is_not_asked_what_was_written_ends_the_grasp(emulated, word, why):
    arm = emulated()
    driver = opened(arm)
    driver.read(0.1)
    arm.tell(word)
    with pytest.raises(DeviceLost, match=why):
        driver.read(0.1)
    driver.close()
    assert not arm.state()["torque"]


@pytest.mark.slow
def test_a_program_that_is_killed_leaves_no_gripper_that_presses(emulated):
    arm = emulated()
    settings = {"port": arm.where, "reply_timeout_s": 10.0, "calibration": "none"}
    assert_a_killed_program_lets_go("so101", lambda: arm.state()["torque"], 8.0, **settings)


@pytest.mark.slow
@every_case("named", ["port", "by-id"])
def test_a_gripper_whose_cable_is_plugged_in_again_no_longer_presses(emulated, tmp_path, monkeypatch, named):
    """A port that is found by its number, as in /dev/serial/by-id, has its name again."""
    monkeypatch.setattr(serial_converters, "BY_ID", str(tmp_path))
    arm, port = emulated(), tmp_path / "port"
    port.symlink_to(arm.where)
    driver = opened(arm, port=str(port) if named == "port" else arm.where)
    driver.read(0.1)
    driver.apply(Command(VELOCITY, -0.03, 8.0, 0.15))
    arm.tell("unplug")
    with pytest.raises(DeviceLost):
        driver.read(0.1)
    driver.close()
    assert arm.state()["torque"]
    port.unlink()
    arm.tell("plug")
    port.symlink_to(arm.where)
    until_s = time.monotonic() + PATIENT_S
    while arm.state()["torque"] and time.monotonic() < until_s:
        time.sleep(0.01)
    assert not arm.state()["torque"]


def test_a_second_host_is_refused_the_port(emulated):
    arm = emulated()
    bus = ServoBus(arm.where, PATIENT_S)
    with pytest.raises(NoDevice, match="another program"):
        driver_of(arm).open(1)
    bus.close()


def test_a_late_or_repeated_reply_is_not_taken_for_that_of_the_next_request(emulated):
    arm = emulated()
    bus, asked = ServoBus(arm.where, PATIENT_S), MotorRequest(0, 7, 2000, 0, 11, 300)
    for _ in range(2):
        arm.tell("repeated")
        assert len(bus.read(6, *STATE)) == STATE[1]
        arm.tell("well")
        bus.write(6, STATE[0], asked.written())
        assert motor_state(bus.read(6, *STATE)).asked == asked
    bus.close()


@pytest.mark.slow
@every_case(
    ("keys", "emulator", "why"),
    [
        ({}, {"faults": So101Faults(model_number=1284)}, "model 1284"),
        ({"motor": 9, "reply_timeout_s": 0.05}, {}, "motor 9: no reply"),
        ({"motor": 3}, {}, "lerobot-calibrate"),
        ({"port": "/dev/nowhere"}, {}, "no such port"),
    ],
)
def test_another_device_is_told_with_what_to_look_at_and_not_written_to(emulated, keys, emulator, why):
    arm = emulated(**emulator)
    with pytest.raises(NoDevice, match=why):
        driver_of(arm, **keys).open(1)
    assert (arm.state()["torque"], arm.state()["written_to_others"]) == (False, 0)


JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll")


def arm_file(path, **changed):
    motor = {"drive_mode": 0, "range_min": 900, "range_max": 3000}
    motors = {name: {**motor, "id": i, "homing_offset": 10 * i} for i, name in enumerate(JOINTS, 1)}
    gripper = {"id": 6, "drive_mode": 0, "homing_offset": -120, "range_min": 1600, "range_max": 2179}
    path.write_text(json.dumps({**motors, "gripper": {**gripper, **changed}}))
    return str(path)


@pytest.mark.usefixtures("own_time")
def test_the_calibration_of_lerobot_has_to_be_that_of_this_arm(emulated, tmp_path):
    arm = emulated()
    bus = ServoBus(arm.where, PATIENT_S)
    most = int.from_bytes(bus.read(6, 11, 2), "little")
    bus.close()
    driver = opened(arm, arm_calibration=arm_file(tmp_path / "arm.json", range_max=most))
    assert driver.read(1.0).frame.gap_m == pytest.approx(0.086, abs=5e-4)
    driver.close()
    for changed in ({"range_max": most + 5}, {"homing_offset": 4, "range_max": most}, {"id": 5}):
        with pytest.raises(NoDevice, match="another arm"):
            opened(arm, arm_calibration=arm_file(tmp_path / "other.json", **changed))


DAMAGED = (
    *("", "[]", "{}", "\x00\xff", "[" * 100_000),
    *('{"gripper": 3}', '{"gripper": {"id": "6"}}', '{"gripper": {}}'),
)
IMPOSSIBLE = ({"range_min": 3000}, {"homing_offset": 1e9}, {"id": True})


def test_a_damaged_calibration_of_an_arm_is_told(tmp_path):
    path = tmp_path / "arm.json"
    driver = create("sensor-backend", "so101", arm_calibration=str(path))
    with pytest.raises(ConfigError, match="cannot be read"):
        driver.open(1)
    for text in DAMAGED:
        path.write_text(text, encoding="latin-1")
        with pytest.raises(DataDamaged, match="LeRobot"):
            driver.open(1)
    for changed in IMPOSSIBLE:
        arm_file(path, **changed)
        with pytest.raises(DataDamaged, match="lerobot-calibrate"):
            driver.open(1)


def test_less_than_moves_the_geared_motor_is_refused_before_anything_moves():
    with pytest.raises(WiringError, match="3 N"):
        load_pipeline("so101", options=["gripper.port=/dev/nowhere", "controller.approach_force_n=2"])


@pytest.mark.slow
def test_doctor_tells_the_gripper_from_another_motor_from_a_silent_bus_and_from_none(emulated):
    arm = emulated()
    states = []
    for port, motor in ((arm.where, 6), (arm.where, 2), (arm.where, 9), ("/dev/nowhere", 6)):
        config = So101Config(port=port, motor=motor, reply_timeout_s=1.0 if motor == 9 else PATIENT_S)
        finding = next(iter(diagnose(config, PATIENT_S)))
        states.append(finding.state)
        assert ("answer: 1, 2, 3, 4, 5, 6" in finding.words) == (motor == 9)
    assert states == ["ok", "problem", "problem", "problem"]
    assert not arm.state()["torque"]
