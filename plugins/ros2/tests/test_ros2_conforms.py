"""The gripper behind ROS 2 passes the conformance checks, with the fake robot behind it."""

import pytest
from robots import OPTIONS, InStep

from graspsense.testing import examine

EXPRESSIONS = ("gap", "left", "right", "through")
KEYS = dict(option.removeprefix("gripper.").split("=", 1) for option in OPTIONS)


@pytest.mark.slow
def test_the_gripper_conforms(robot, monkeypatch):
    InStep(robot().line).install(monkeypatch.setattr)
    keys = {key: KEYS[key] for key in EXPRESSIONS}
    # Whether the action is there is asked in the time of the machine, not in that of the robot.
    absent = {"action": "/nobody", "open_timeout_s": 0.1}

    report = examine("graspsense-ros2/ros2", keys=keys, absent=absent, wheel=False).report()

    assert report.failures == []
