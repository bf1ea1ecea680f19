"""A gripper behind ROS 2, against a robot in another process, sound and with faults."""

import subprocess
import sys
import time

import pytest
from robots import OPTIONS, PATIENCE_S, STEPPED, InStep

from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.values.signals import Outcome

pytestmark = pytest.mark.slow
OBJECT_M = 0.05


@pytest.fixture
def grasped(robot, monkeypatch):
    """What grasps once with a robot, on which `act` acts in this phase, and returns both.

    In the squeeze the object is between the fingers.
    """

    def grasp(*options, kind="GripperCommand", phase="SQUEEZE", act=lambda robot: None):
        fake = robot(kind)
        InStep(fake.line).install(monkeypatch.setattr)
        pipeline = load_pipeline("default", options=[*OPTIONS, *options])
        return fake, pipeline.grasp(on_event=lambda event: event.phase.name == phase and act(fake))

    return grasp


@pytest.mark.parametrize("kind", ["GripperCommand", "ParallelGripperCommand"])
def test_a_grasp_by_topics_and_action(grasped, kind):
    sound, trial = grasped(f"gripper.action_type={kind}", kind=kind)

    assert trial.outcome == Outcome.STEADY, trial.reason
    forces = trial.trace.force_left_n
    assert max(forces) == pytest.approx(15.0, abs=1.5)
    goals = sound.goals()
    # The guard's first limits hold until the pads touch: no goal is further ahead of the fingers than the step.
    assert all(goal["position"] > goal["gap"] - 0.02 for goal in goals)
    assert max(goal["effort"] for goal in goals if goal["position"] < OBJECT_M) <= 20.0
    assert goals[-1]["position"] == pytest.approx(0.085)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("silent", "/wrench"),
        ("nan", "nan"),
        ("wrong", "damaged"),
        ("late", "/wrench"),
    ],
)
def test_a_fault_of_a_topic_ends_the_grasp_and_opens_the_fingers(grasped, fault, words):
    # So long a hold that the grasp does not end before the fault is seen.
    faulty, trial = grasped("run.hold_s=5", act=lambda fake: fake.fault(fault))

    assert trial.outcome == Outcome.DEVICE_LOST
    assert words in trial.reason
    assert trial.report["told_to_open"] is True
    assert faulty.goals()[-1]["position"] == 0.085


@pytest.mark.parametrize(
    ("fault", "name"), [("", None), ("behind", "messages late"), ("twice", "messages repeated")]
)
def test_messages_that_come_late_or_twice_are_told(grasped, fault, name):
    _, trial = grasped(phase="APPROACH", act=lambda fake: fake.fault(fault))

    told = {warning.split(":")[0] for warning in trial.warnings} & {"messages late", "messages repeated"}
    assert told == ({name} if name else set())


def test_a_topic_that_stops_while_the_fingers_open_leaves_them_open(grasped):
    faulty, trial = grasped(phase="RELEASE", act=lambda fake: fake.fault("silent"))

    assert trial.report["told_to_open"] is True
    assert faulty.goals()[-1]["position"] == 0.085


def test_a_robot_that_dies_ends_the_grasp(grasped):
    _, trial = grasped(act=lambda fake: fake.process.kill())

    assert trial.outcome == Outcome.DEVICE_LOST
    assert trial.report["told_to_open"] is False


def test_goals_that_are_refused_end_the_grasp(grasped):
    _, trial = grasped(act=lambda fake: fake.fault("refuse"))

    assert trial.outcome == Outcome.DEVICE_LOST
    assert "refuses" in trial.reason


def test_a_program_that_is_killed_leaves_open_fingers(robot):
    fake = robot()
    words = [word for option in (*OPTIONS, "run.hold_s=100") for word in ("-o", option)]
    until_s = time.monotonic() + PATIENCE_S
    with subprocess.Popen([sys.executable, STEPPED, str(fake.port), "run", *words]) as running:
        while not any(goal["position"] < OBJECT_M for goal in fake.goals()):
            assert time.monotonic() < until_s, "it never closes"
            time.sleep(0.1)
        running.kill()
    while fake.goals()[-1]["position"] != 0.085:
        assert time.monotonic() < until_s, "it is never told to open"
        time.sleep(0.1)
