"""A gripper behind ROS 2, against a robot in another process, sound and with faults."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.values.signals import Outcome

ROBOT = Path(__file__).with_name("fake_robot.py")
OBJECT_M = 0.05
OPTIONS = (
    "gripper.type=ros2",
    "gripper.gap='/joint_states.position'[0]*2",
    "gripper.left=-'/wrench.wrench.force.z'",
    "gripper.right=-'/wrench.wrench.force.z'",
    "gripper.through=zenoh",
    "controller.type=send-and-watch",
    "controller.probing_force_n=15",
    "classifier.type=none",
)


class Robot:
    """The robot's process: its faults, and the goals that it was sent."""

    def __init__(self, kind):
        self.process = subprocess.Popen(
            [sys.executable, str(ROBOT), kind], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def fault(self, name):
        self.process.stdin.write(name + "\n")
        self.process.stdin.flush()

    def goals(self):
        """End the robot, and return its goals."""
        self.process.kill()
        return [json.loads(line) for line in self.process.communicate()[0].splitlines()]


@pytest.fixture
def robot(router):
    running = []

    def start(kind="GripperCommand"):
        running.append(Robot(kind))
        return running[0]

    yield start
    for one in running:
        one.process.kill()
        one.process.communicate()


def grasp(on_event=None, *options):
    return load_pipeline("default", options=[*OPTIONS, *options]).grasp(on_event=on_event)


def at_squeeze(act):
    """Return what acts in the squeeze, when the object is between the fingers."""
    return lambda event: act() if event.phase.name == "SQUEEZE" else None


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["GripperCommand", "ParallelGripperCommand"])
def test_a_grasp_by_topics_and_action(robot, kind):
    sound = robot(kind)

    trial = grasp(None, f"gripper.action_type={kind}")

    assert trial.outcome == Outcome.STEADY, trial.reason
    forces = trial.trace.force_left_n
    assert max(forces) == pytest.approx(15.0, abs=1.5)
    goals = sound.goals()
    # The guard's first limits hold until the pads touch: no goal is further ahead of the fingers than the step.
    assert all(goal["position"] > goal["gap"] - 0.02 for goal in goals)
    assert max(goal["effort"] for goal in goals if goal["position"] < OBJECT_M) <= 20.0
    assert goals[-1]["position"] == pytest.approx(0.085)


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "words"), [
    ("silent", "/wrench"), ("nan", "nan"), ("wrong", "damaged"), ("late", "/wrench"),
])
def test_a_fault_of_a_topic_ends_the_grasp_and_opens_the_fingers(robot, fault, words):
    faulty = robot()

    trial = grasp(at_squeeze(lambda: faulty.fault(fault)))

    assert trial.outcome == Outcome.DEVICE_LOST
    assert words in trial.reason
    assert trial.report["told_to_open"] is True
    assert faulty.goals()[-1]["position"] == 0.085


@pytest.mark.slow
def test_a_robot_that_dies_ends_the_grasp(robot):
    dying = robot()

    trial = grasp(at_squeeze(dying.process.kill))

    assert trial.outcome == Outcome.DEVICE_LOST
    assert trial.report["told_to_open"] is False


@pytest.mark.slow
def test_goals_that_are_refused_end_the_grasp(robot):
    refusing = robot()

    trial = grasp(at_squeeze(lambda: refusing.fault("refuse")))

    assert trial.outcome == Outcome.DEVICE_LOST
    assert "refuses" in trial.reason
