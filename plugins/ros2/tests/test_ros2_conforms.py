"""The gripper behind ROS 2 passes the conformance checks, with the fake robot behind it."""

import pytest
from robots import OPTIONS, TRIES

from graspsense.testing import examine

EXPRESSIONS = ("gap", "left", "right", "through")
KEYS = dict(option.removeprefix("gripper.").split("=", 1) for option in OPTIONS)


@pytest.mark.slow
def test_the_gripper_conforms(robot):
    robot()
    keys = {key: KEYS[key] for key in EXPRESSIONS} | {"silent_s": 1.0}

    for _ in range(TRIES):
        report = examine(
            "graspsense-ros2/ros2", keys=keys, absent={"action": "/nobody"}, wheel=False
        ).report()
        if "aborted" not in str(report.failures):
            break

    assert report.failures == []
