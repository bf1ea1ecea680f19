"""The fake robot as a process, and the settings of its gripper."""

import json
import subprocess
import sys
from pathlib import Path

ROBOT = Path(__file__).with_name("fake_robot.py")
OPTIONS = (
    "gripper.type=ros2",
    "gripper.gap='/joint_states.position'[0]*2",
    "gripper.left=-'/wrench.wrench.force.z'",
    "gripper.right=-'/wrench.wrench.force.z'",
    "gripper.through=zenoh",
    # The tests share their processors with others.
    "gripper.delay_s=0.4",
    "controller.step_time_s=0.4",
    "gripper.silent_s=1.0",
    "gripper.open_timeout_s=30",
    "controller.type=send-and-watch",
    "controller.probing_force_n=15",
    "classifier.type=none",
)


PATIENCE_S = 300.0
"""What a test waits for comes within this time, or not at all."""
TRIES = 10
"""A grasp is tried so often: that of a machine that is held up loses frames, and is aborted."""


class Robot:
    """The robot's process, once it publishes: its faults, and the goals that it was sent."""

    def __init__(self, kind):
        self.process = subprocess.Popen(
            [sys.executable, str(ROBOT), kind], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self.process.stdout.readline() == "ready\n"

    def fault(self, name):
        self.process.stdin.write(name + "\n")
        self.process.stdin.flush()

    def end(self):
        """End the robot, and return what it printed."""
        self.process.kill()
        return self.process.communicate()[0]

    def goals(self):
        """End the robot, and return its goals."""
        return [json.loads(line) for line in self.end().splitlines()]
