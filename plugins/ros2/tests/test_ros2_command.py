"""`graspsense ros2`: other nodes ask for grasps and move the gripper."""

import json
import signal
import subprocess
import sys
import threading
import uuid
from contextlib import contextmanager
from itertools import product

import pytest
from cases import every_case
from commands import refused
from robots import OPTIONS, PATIENCE_S, STEPPED

from graspsense_ros2.command import ACTION, GRASP, GRIPPER_COMMAND, TRIGGER
from graspsense_ros2.message_types import decode, encode
from graspsense_ros2.node import ServiceFailed
from graspsense_ros2.zenoh_node import ZenohNode

CANCEL = "action_msgs/srv/CancelGoal"
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
OPEN_M = 0.085

pytestmark = pytest.mark.slow


@contextmanager
def served(robot, *flags, ending=signal.SIGINT):
    """Run the command in step with the robot; it is stopped as by Ctrl-C, or by another signal."""
    options = [word for option in OPTIONS for word in ("-o", option)]
    command = [sys.executable, STEPPED, str(robot.port), "ros2", "--through", "zenoh", *flags, *options]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        for _ in flags:
            assert process.stderr.readline().startswith("offered")
        yield process
        process.send_signal(ending)
        assert process.wait(PATIENCE_S) == 0, process.stderr.read()
    finally:
        process.kill()
        process.communicate()


class Caller:
    """Another node, which sends goals and asks for results."""

    def __init__(self):
        self.node = ZenohNode("caller")
        parts = {
            "send_goal": f"{ACTION}_SendGoal",
            "get_result": f"{ACTION}_GetResult",
            "cancel_goal": CANCEL,
        }
        self.asks = {
            name: self.node.client(f"{GRIPPER_COMMAND}/_action/{name}", parts[name]) for name in parts
        }
        self.trigger = self.node.client(GRASP, TRIGGER)

    def send(self, position, effort):
        goal = {"goal_id": {"uuid": list(uuid.uuid4().bytes)}}
        asked = {**goal, "goal": {"command": {"position": position, "max_effort": effort}}}
        answer = self.asks["send_goal"](encode(f"{ACTION}_SendGoal_Request", asked), PATIENCE_S)
        return goal, decode(f"{ACTION}_SendGoal_Response", answer).accepted

    def result(self, goal):
        answer = self.asks["get_result"](encode(f"{ACTION}_GetResult_Request", goal), PATIENCE_S)
        return decode(f"{ACTION}_GetResult_Response", answer)

    def cancel(self, goal):
        answer = self.asks["cancel_goal"](encode(f"{CANCEL}_Request", {"goal_info": goal}), PATIENCE_S)
        return decode(f"{CANCEL}_Response", answer)

    def grasp(self):
        answer = self.trigger(encode(f"{TRIGGER}_Request", {}), PATIENCE_S)
        return decode(f"{TRIGGER}_Response", answer)


@pytest.fixture
def caller(router):
    made = Caller()
    yield made
    made.node.close()


def test_a_grasp_is_asked_for(robot, caller):
    with served(robot(), "--grasp"):
        answer = caller.grasp()

        told = json.loads(answer.message)
        assert (answer.success, told["outcome"]) == (True, "steady")
        assert set(told) == {"outcome", "reason", "features", "prediction", "counts"}
        # What was not asked for is not offered.
        with pytest.raises(ServiceFailed, match="does not answer"):
            caller.asks["cancel_goal"](encode(f"{CANCEL}_Request", {}), 1.0)


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_a_goal_holds_the_object_and_the_end_opens(robot, caller, ending):
    sound = robot()
    feedback, came = [], threading.Event()

    def take(data):
        feedback.append(decode(f"{ACTION}_FeedbackMessage", data))
        came.set()

    caller.node.subscribe(f"{GRIPPER_COMMAND}/_action/feedback", f"{ACTION}_FeedbackMessage", take)
    with served(sound, "--action", ending=ending):
        goal, accepted = caller.send(0.0, 10.0)
        held = caller.result(goal)

        assert accepted
        assert (held.status, held.result.stalled, held.result.reached_goal) == (SUCCEEDED, True, False)
        assert held.result.position == pytest.approx(0.05 - 10.0 / 2000.0, abs=1e-3)
        assert held.result.effort == pytest.approx(10.0, abs=1.0)
        assert came.wait(PATIENCE_S)
        assert bytes(feedback[0].goal_id.uuid) == bytes(goal["goal_id"]["uuid"])

    goals = sound.goals()
    assert max(goal["effort"] for goal in goals if goal["position"] < goal["gap"]) <= 10.0
    assert goals[-1]["position"] == pytest.approx(OPEN_M)


def test_goals_are_cancelled_replaced_and_refused(robot, caller):
    with served(robot(), "--action", "--grasp"):
        canceled, _ = caller.send(0.02, 5.0)
        assert len(caller.cancel(canceled).goals_canceling) == 1
        assert caller.result(canceled).status == CANCELED
        assert caller.cancel(canceled).return_code == 3
        assert caller.cancel({"goal_id": {"uuid": [7] * 16}}).return_code == 2

        replaced, _ = caller.send(0.02, 5.0)
        newer, _ = caller.send(0.08, 5.0)
        assert caller.result(replaced).status == ABORTED
        done = caller.result(newer)
        assert (done.status, done.result.reached_goal) == (SUCCEEDED, True)

        for position, effort in ((float("nan"), 5.0), (0.03, float("inf")), (-0.1, 5.0)):
            assert not caller.send(position, effort)[1]
        # The gripper is let go for a grasp, and can be moved again.
        assert caller.grasp().success
        again, _ = caller.send(0.07, 5.0)
        assert caller.result(again).status == SUCCEEDED


def test_a_robot_that_dies_ends_the_goal_and_not_the_node(robot, caller):
    dying = robot()
    with served(dying, "--action", "--grasp"):
        goal, _ = caller.send(0.0, 10.0)
        dying.process.kill()

        assert caller.result(goal).status == ABORTED
        answer = caller.grasp()
        assert (answer.success, "nobody publishes" in answer.message) == (False, True)


def test_rubbish_is_answered_with_an_error(robot, caller):
    with served(robot(), "--action"):
        for request_bytes, ask in product((b"", b"\0", b"\0\1\0\0", b"\xff" * 4000), caller.asks.values()):
            with pytest.raises(ServiceFailed):
                ask(request_bytes, PATIENCE_S)
        goal, accepted = caller.send(OPEN_M, 5.0)
        assert accepted
        assert caller.result(goal).status == SUCCEEDED


@every_case(
    ("words", "said"),
    [
        ([], "--grasp"),
        (["--action", "--gripper", "pr2"], "positions or velocities"),
        (["--grasp", "-o", "a.b=1"], "a"),
    ],
)
def test_wrong_uses(words, said):
    assert said in refused("ros2", *words)
