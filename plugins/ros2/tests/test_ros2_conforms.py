"""The gripper behind ROS 2 passes the conformance checks, with the fake robot behind it."""

from __future__ import annotations

import pytest
from robots import OPTIONS

from graspsense.testing import examine

KEYS = dict(
    option.removeprefix("gripper.").split("=", 1) for option in OPTIONS if option.startswith("gripper.")
)


@pytest.mark.slow
def test_the_gripper_conforms(robot):
    robot()
    keys = {key: value for key, value in KEYS.items() if key != "type"}

    report = examine("graspsense-ros2/ros2", keys=keys, absent={"action": "/nobody"}, wheel=False).report()

    assert report.failures == []
