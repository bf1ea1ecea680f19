"""rclpy, where it is installed: its subscriptions, its service client and its action client use our node.

python with_rclpy.py, in an environment that has graspsense, rclpy, and the interfaces of ROS, which include the action
test_msgs/action/Fibonacci but no control_msgs.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import WrenchStamped
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger
from test_msgs.action import Fibonacci

from graspsense_ros2 import message_types
from graspsense_ros2.action_server import ActionServer
from graspsense_ros2.middleware import open_node
from graspsense_ros2.rclpy_node import RclpyNode

PATIENCE_S = 60.0
QUIET_S = 3.0
"""Time without a message after which none is left."""
RUN = ("-m", "graspsense", "ros2", "--grasp", "--gripper", "pr2")
OPTIONS = ("-o", "gripper.transport=emulated")
TOPICS = {
    "joint_states": JointState,
    "wrench/left": WrenchStamped,
    "tactile/pads_left": Float64MultiArray,
    "events": String,
    "outcome": String,
}
FIBONACCI = "test_msgs/action/Fibonacci"


def until_done(executor, future):
    executor.spin_until_future_complete(future, PATIENCE_S)
    assert future.done()
    return future.result()


def judge_grasp(node, executor):
    """A service client asks for a grasp, and subscriptions receive it."""
    messages = {name: [] for name in TOPICS}
    for name, kind in TOPICS.items():
        node.create_subscription(kind, f"/graspsense/{name}", messages[name].append, 10_000)
    process = subprocess.Popen([sys.executable, *RUN, *OPTIONS])
    try:
        client = node.create_client(Trigger, "/graspsense/grasp")
        assert client.wait_for_service(PATIENCE_S)
        # With the first grasp the topics and their subscriptions become known to each other.
        for _ in range(2):
            for received in messages.values():
                received.clear()
            answer = until_done(executor, client.call_async(Trigger.Request()))
            assert answer.success, answer
            told = json.loads(answer.message)
            # The executor takes from each queue in turn, so the last message is not the last that it takes.
            taken, quiet_s = 0, time.monotonic()
            while time.monotonic() - quiet_s < QUIET_S:
                executor.spin_once(QUIET_S)
                if (now := sum(map(len, messages.values()))) > taken:
                    taken, quiet_s = now, time.monotonic()
    finally:
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0, process.returncode
    assert all(messages.values()), {name: len(received) for name, received in messages.items()}
    assert json.loads(messages["outcome"][0].data)["outcome"] == told["outcome"] == "steady", told
    missed = told["counts"]["ticks"] - len(messages["joint_states"])
    assert missed == 0, (missed, told["counts"])
    assert max(wrench.wrench.force.z for wrench in messages["wrench/left"]) > 1.0
    assert len(messages["tactile/pads_left"][0].data) == 22
    counts = {name: len(message) for name, message in messages.items()}
    sys.stdout.write(f"with rclpy: {counts}, {told['outcome']}\n")


def judge_action(node, executor):
    """An action client sends goals, receives feedback and results, and cancels."""
    ours = open_node("graspsense_action")
    assert isinstance(ours, RclpyNode), "rclpy is there, so it has to be used"

    def execute(goal):
        goal.publish({"sequence": [0, 1]})
        if goal.asked.order > 10:
            goal.stop.wait(PATIENCE_S)
        return not goal.stop.is_set(), {"sequence": [0, 1, 1, 2]}

    ActionServer(ours, "/fibonacci", FIBONACCI, lambda goal: goal.order > 0, execute)
    client, feedback = ActionClient(node, Fibonacci, "/fibonacci"), []
    assert client.wait_for_server(PATIENCE_S)
    sent = client.send_goal_async(Fibonacci.Goal(order=4), feedback_callback=feedback.append)
    goal = until_done(executor, sent)
    assert goal.accepted
    result = until_done(executor, goal.get_result_async())
    assert (result.status, list(result.result.sequence)) == (GoalStatus.STATUS_SUCCEEDED, [0, 1, 1, 2]), (
        result
    )
    assert list(feedback[0].feedback.sequence) == [0, 1], feedback

    assert not until_done(executor, client.send_goal_async(Fibonacci.Goal(order=0))).accepted
    long = until_done(executor, client.send_goal_async(Fibonacci.Goal(order=20)))
    canceling = until_done(executor, long.cancel_goal_async())
    assert len(canceling.goals_canceling) == 1, canceling
    assert until_done(executor, long.get_result_async()).status == GoalStatus.STATUS_CANCELED
    ours.close()
    sys.stdout.write("with rclpy: an action client was served\n")


def judge_subscription(node, executor):
    """Our node finds the type of a topic and receives its messages."""
    publisher = node.create_publisher(JointState, "/robot/joint_states", 10)
    ours, came, data = open_node("graspsense_gripper"), threading.Event(), []

    def take(message):
        data.append(message)
        came.set()

    until = time.monotonic() + PATIENCE_S
    while ours.types_of("/robot/joint_states") != ("sensor_msgs/msg/JointState",):
        assert time.monotonic() < until
        time.sleep(0.1)
    ours.subscribe("/robot/joint_states", "sensor_msgs/msg/JointState", take)
    while not came.wait(0.1):
        assert time.monotonic() < until
        publisher.publish(JointState(name=["finger"], position=[0.04]))
    message = message_types.decode("sensor_msgs/msg/JointState", data[0])
    assert (message.name, list(message.position)) == (["finger"], [0.04]), message
    ours.close()
    sys.stdout.write("with rclpy: a topic was received\n")


def main():
    os.environ.setdefault("ROS_DOMAIN_ID", "83")
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    # Before the first message, which makes the types.
    message_types._ACTIONS[FIBONACCI] = ("int32 order", "int32[] sequence", "int32[] sequence")
    rclpy.init()
    node, executor = rclpy.create_node("judge"), SingleThreadedExecutor()
    executor.add_node(node)
    judge_subscription(node, executor)
    judge_action(node, executor)
    judge_grasp(node, executor)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
