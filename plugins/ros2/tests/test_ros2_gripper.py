"""A gripper behind ROS 2, against a robot in another process, sound and with faults."""

import pytest
from robots import OPTIONS, TRIES

from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.values.signals import Outcome

OBJECT_M = 0.05


def undisturbed(start, *options, phase="SQUEEZE", act=lambda robot: None):
    """Return a robot, and a grasp with it that was not aborted. `act` acts on the robot in this phase of the grasp.

    In the squeeze the object is between the fingers.
    """
    for _ in range(TRIES):
        fake = start()
        pipeline = load_pipeline("default", options=[*OPTIONS, *options])
        trial = pipeline.grasp(on_event=lambda event, fake=fake: event.phase.name == phase and act(fake))
        if trial.outcome != Outcome.ABORTED:
            break
        fake.end()
    return fake, trial


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["GripperCommand", "ParallelGripperCommand"])
def test_a_grasp_by_topics_and_action(robot, kind):
    sound, trial = undisturbed(lambda: robot(kind), f"gripper.action_type={kind}")

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
    # So long a hold that the grasp does not end before the fault is seen.
    faulty, trial = undisturbed(robot, "run.hold_s=5", act=lambda fake: fake.fault(fault))

    assert trial.outcome == Outcome.DEVICE_LOST
    assert words in trial.reason
    assert trial.report["told_to_open"] is True
    assert faulty.goals()[-1]["position"] == 0.085


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "name"), [("", None), ("behind", "messages late"), ("twice", "messages repeated")]
)
def test_messages_that_come_late_or_twice_are_told(robot, fault, name):
    _, trial = undisturbed(robot, phase="APPROACH", act=lambda fake: fake.fault(fault))

    # A machine that is held up has late messages too.
    told = {warning.split(":")[0] for warning in trial.warnings} & {"messages late", "messages repeated"}
    assert name in told if name else "messages repeated" not in told


@pytest.mark.slow
def test_a_topic_that_stops_while_the_fingers_open_leaves_them_open(robot):
    faulty, trial = undisturbed(robot, phase="RELEASE", act=lambda fake: fake.fault("silent"))

    assert trial.report["told_to_open"] is True
    assert faulty.goals()[-1]["position"] == 0.085


@pytest.mark.slow
def test_a_robot_that_dies_ends_the_grasp(robot):
    _, trial = undisturbed(robot, act=lambda fake: fake.process.kill())

    assert trial.outcome == Outcome.DEVICE_LOST
    assert trial.report["told_to_open"] is False


@pytest.mark.slow
def test_goals_that_are_refused_end_the_grasp(robot):
    _, trial = undisturbed(robot, act=lambda fake: fake.fault("refuse"))

    assert trial.outcome == Outcome.DEVICE_LOST
    assert "refuses" in trial.reason
