"""A gripper behind ROS 2, against a robot in another process, sound and with faults."""

import pytest
from robots import OPTIONS

from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.values.signals import Outcome

OBJECT_M = 0.05


def grasp(on_event=None, *options):
    return load_pipeline("default", options=[*OPTIONS, *options]).grasp(on_event=on_event)


def undisturbed(*options):
    """Return a grasp in which this process was not held up: one that is loses frames, and its clock jumps."""
    for _ in range(10):
        trial = grasp(None, *options)
        if not any(word in trial.reason for word in ("lost:", "clock jumps")):
            break
    return trial


def at_squeeze(act):
    """Return what acts in the squeeze, when the object is between the fingers."""
    return lambda event: act() if event.phase.name == "SQUEEZE" else None


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["GripperCommand", "ParallelGripperCommand"])
def test_a_grasp_by_topics_and_action(robot, kind):
    sound = robot(kind)

    trial = undisturbed(f"gripper.action_type={kind}")

    assert trial.outcome == Outcome.STEADY, trial.reason
    forces = trial.trace.force_left_n
    assert max(forces) == pytest.approx(15.0, abs=1.5)
    goals = sound.goals()
    # The guard's first limits hold until the pads touch: no goal is further ahead of the fingers than the step.
    assert all(goal["position"] > goal["gap"] - 0.02 for goal in goals)
    assert max(goal["effort"] for goal in goals if goal["position"] < OBJECT_M) <= 20.0
    assert goals[-1]["position"] == pytest.approx(0.085)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("silent", "/wrench"),
        ("nan", "nan"),
        ("wrong", "damaged"),
        ("late", "/wrench"),
    ],
)
def test_a_fault_of_a_topic_ends_the_grasp_and_opens_the_fingers(robot, fault, words):
    faulty = robot()

    # So long a hold that the grasp does not end before the fault is seen.
    trial = grasp(at_squeeze(lambda: faulty.fault(fault)), "run.hold_s=5")

    assert trial.outcome == Outcome.DEVICE_LOST
    assert words in trial.reason
    assert trial.report["told_to_open"] is True
    assert faulty.goals()[-1]["position"] == 0.085


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "name"), [("", None), ("behind", "messages late"), ("twice", "messages repeated")]
)
def test_messages_that_come_late_or_twice_are_told(robot, fault, name):
    faulty = robot()

    trial = grasp(lambda event: faulty.fault(fault) if event.phase.name == "APPROACH" else None)

    # A machine that is held up has late messages too.
    told = {warning.split(":")[0] for warning in trial.warnings} & {"messages late", "messages repeated"}
    assert name in told if name else "messages repeated" not in told


@pytest.mark.slow
def test_a_topic_that_stops_while_the_fingers_open_leaves_them_open(robot):
    faulty = robot()

    trial = grasp(lambda event: faulty.fault("silent") if event.phase.name == "RELEASE" else None)

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
