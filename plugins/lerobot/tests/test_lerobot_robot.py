"""A robot of LeRobot as a gripper: one motor is commanded alone, gently, and stopped on every way out."""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import pytest
from cases import every_case
from lerobot_fake_arm import Clock, FakeArm
from lerobot_sets import write_set

from graspsense import load_pipeline
from graspsense.plugin_api import (
    FORCE,
    POSITION,
    VELOCITY,
    Command,
    ConfigError,
    DeviceLost,
    NoDevice,
    PluginUnavailable,
    create,
)
from graspsense.testing_api import parametrize_checks
from graspsense_lerobot import backend
from graspsense_lerobot.robot import stop

KEYS = {"robot": "fake_arm", "load": "Present_Load"}


@pytest.fixture(autouse=True)
def own_time(monkeypatch):
    Clock.now_s = 0.0
    FakeArm.made.clear()
    monkeypatch.setattr(backend, "time", SimpleNamespace(monotonic=Clock.monotonic, sleep=Clock.sleep))


def gripper(robot_config=None, **keys):
    return create("sensor-backend", "lerobot", **{**KEYS, "robot_config": robot_config or {}, **keys})


def readings(driver, n):
    return [driver.read(0.1) for _ in range(n)]


EXAMPLES = TemporaryDirectory()
write_set(Path(EXAMPLES.name) / "set", 3)


@pytest.mark.slow
@parametrize_checks(
    "graspsense-lerobot",
    wheel=False,  # .ci/lerobot runs from the wheel
    keys=KEYS,
    data={"lerobot": f"{EXAMPLES.name}/set"},
    unplugged={"robot_config": {"unplugged_s": 0.5}},
    absent={"robot_config": {"port": "nowhere"}},
)
def test_conformance(check):
    check.run()


def test_a_grasp_commands_the_gripper_alone_and_leaves_it_free():
    options = ["gripper.type=lerobot", "gripper.robot=fake_arm", "gripper.load=Present_Load"]
    options += ["controller.type=send-and-watch", "features.type=chitta-without-pads", "classifier.type=none"]
    options += ["controller.closing_speed_m_s=0.015", "controller.probing_force_n=12"]
    options += ["controller.rest_window_s=0.3"]
    trial = load_pipeline("default", options=options).grasp()
    (arm,) = FakeArm.made

    assert trial.outcome.words == "steady", trial.reason
    assert {key for action in arm.actions for key in action} == {"gripper.pos"}
    # The object is 50 mm wide and yields by 0.6 mm under 12 N.
    assert 0.048 < min(trial.trace.gap_m) < 0.05
    assert max(trial.trace.effort_n) <= 12.5
    assert arm.target_m >= arm.gap_m - 1e-9, "the servo pushes no longer"
    assert not arm.connected


def commanded(command, ticks, **keys):
    """Yield the arm of a gripper with these settings, and its force (N), in each tick of a command and when closed."""
    driver = gripper(**keys)
    driver.open(1)
    (arm,) = FakeArm.made
    for _ in range(ticks):
        driver.read(0.1)
        driver.apply(command)
        yield arm, arm.force_n
    driver.close()
    yield arm, 0.0


def greatest_force_n(command, ticks, **keys):
    return max(force_n for _, force_n in commanded(command, ticks, **keys))


@pytest.mark.parametrize("load", ["none", "Present_Load"])
@pytest.mark.parametrize(("kind", "value"), [(POSITION, 0.0), (VELOCITY, -0.05), (FORCE, 6.0)])
def test_no_command_squeezes_harder_than_its_limit(kind, value, load):
    assert 4.0 < greatest_force_n(Command(kind, value, 6.0, 0.05), 120, load=load) <= 6.01


def test_a_stronger_servo_than_declared_is_held_back_by_the_measured_load():
    most_n = greatest_force_n(Command(POSITION, 0.0, 6.0, 0.01), 200, newtons_per_metre=200.0)
    # It notices after a frame, in which the target moves by 0.33 mm.
    assert most_n <= 6.0 + 2.0 * 1000.0 * 0.01 / 30.0


def test_close_stops_the_fingers_where_they_are():
    squeezed_m = [arm.gap_m - arm.target_m for arm, _ in commanded(Command(POSITION, 0.0, 10.0, 0.05), 60)]
    (arm,) = FakeArm.made
    assert squeezed_m[-2] > 0.0
    assert arm.target_m == pytest.approx(arm.gap_m, abs=1e-6)
    assert not arm.connected


def test_the_gripper_of_a_killed_program_is_stopped_where_it_is():
    stop(json.dumps({"robot": "fake_arm", "motor": "gripper"}))
    (arm,) = FakeArm.made
    # Its gap is 70 of 80 mm.
    assert (arm.actions, arm.connected) == ([{"gripper.pos": pytest.approx(87.5)}], False)


def test_degrees_and_a_reversed_scale_become_metres():
    keys = {"unit": "degrees", "open_position": -10.0, "closed_position": 30.0, "open_gap_m": 0.06}
    jaw = gripper(**keys).config
    assert [*map(jaw.gap_m, (-10.0, 30.0, 10.0))] == pytest.approx([0.06, 0.0, 0.03])
    assert [*map(jaw.position_at, (0.03, 1.0, -1.0))] == pytest.approx([10.0, -10.0, 30.0])


def test_a_damaged_answer_is_asked_again_and_a_lost_robot_is_told():
    driver = gripper({"damaged_every": 7})
    driver.open(1)
    readings(driver, 30)
    driver.close()
    assert driver.report()["frames"] == 30
    assert driver.report()["repeated"] > 0

    driver = gripper({"unplugged_s": 0.3})
    driver.open(1)
    with pytest.raises(DeviceLost, match="no status packet"):
        readings(driver, 30)
    driver.close()


@every_case(
    ("keys", "error", "word"),
    [
        ({"robot_config": {"wants_all": True}}, NoDevice, "alone"),
        ({"robot_config": {"moves_others": True}}, NoDevice, "elbow_flex"),
        ({"robot_config": {"calibrated": False}}, NoDevice, "lerobot-calibrate"),
        ({"robot_config": {"port": "nowhere"}}, NoDevice, "nowhere"),
        ({"robot_config": {"driver": False}}, PluginUnavailable, "scservo_sdk"),
        ({"robot_config": {"nonsense": 1}}, ConfigError, "nonsense"),
        ({"robot": "no_such_robot"}, ConfigError, "fake_arm"),
        ({"motor": "claw"}, ConfigError, "gripper.pos"),
    ],
)
def test_a_robot_that_cannot_be_used_is_refused_with_the_reason(keys, error, word):
    with pytest.raises(error, match=word):
        gripper(**keys).open(1)
    assert not any(arm.connected for arm in FakeArm.made)


def test_without_lerobot_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "lerobot.robots", None)
    with pytest.raises(PluginUnavailable, match="pip install lerobot"):
        gripper().open(1)
