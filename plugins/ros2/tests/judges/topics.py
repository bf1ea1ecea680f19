"""zenoh-ros2-sdk lists and decodes every topic of a grasp, for an environment that has it but not graspsense.

python topics.py GRASPSENSE: GRASPSENSE is the program. Its node is asked for three grasps. The topics of
the first one are listed, and those of the last one decoded.
"""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections import defaultdict
from itertools import pairwise

from rosbags.typesys import Stores, get_typestore
from routers import opened_router
from zenoh_ros2_sdk import (
    ROS2ServiceClient,
    ROS2Subscriber,
    get_service_info,
    get_topic_info,
    get_topic_names_and_types,
)
from zenoh_ros2_sdk.utils import compute_type_hash_from_msg

RUN = (
    *("ros2", "--grasp", "--gripper", "pr2", "-o", "gripper.transport=emulated"),
    *("-o", "gripper.object=odwalla:full_open", "-o", "run.seed=3"),
)
GRASP = "/graspsense/grasp"
PATIENCE_S = 120.0
QUIET_S = 3.0
"""Time without a message after which none is left."""
EXPECTED = {
    "/graspsense/joint_states": "sensor_msgs/msg/JointState",
    "/graspsense/wrench/left": "geometry_msgs/msg/WrenchStamped",
    "/graspsense/wrench/right": "geometry_msgs/msg/WrenchStamped",
    "/graspsense/tactile/pads_left": "std_msgs/msg/Float64MultiArray",
    "/graspsense/tactile/pads_right": "std_msgs/msg/Float64MultiArray",
    "/graspsense/events": "std_msgs/msg/String",
    "/graspsense/prediction": "std_msgs/msg/String",
    "/graspsense/outcome": "std_msgs/msg/String",
}


def definitions(type_name):
    """Return the definition of a type with those that it uses, and each of these alone, as ROS ships them."""
    whole, _ = get_typestore(Stores.ROS2_JAZZY).generate_msgdef(type_name, ros_version=2)
    own, *others = whole.split("=" * 80 + "\nMSG: ")
    used = {}
    for other in others:
        name, _, text = other.partition("\n")
        package, _, short = name.partition("/")
        used[f"{package}/msg/{short}"] = text
    return whole, own, used


def asked_to_grasp(port):
    """Ask for a grasp, and return what the answer tells of it."""
    info = wait_for(lambda: get_service_info(GRASP, router_port=port, timeout=0.5, verbose=True), GRASP)
    client = ROS2ServiceClient(
        GRASP,
        "std_srvs/srv/Trigger",
        request_definition="uint8 structure_needs_at_least_one_member",
        response_definition="bool success\nstring message",
        type_hash=info.servers[0].type_hash,
        router_port=port,
        timeout=PATIENCE_S,
    )
    answer = client.call(structure_needs_at_least_one_member=0)
    assert answer.success, answer
    return json.loads(answer.message)


def wait_for(look, what):
    """Wait until this returns something true, and return it."""
    until = time.monotonic() + PATIENCE_S
    while not (result := look()):
        assert time.monotonic() < until, what
        time.sleep(0.2)
    return result


def until_quiet(messages):
    """Wait for the last messages: each topic has a thread of its own here, so the outcome may overtake the ticks."""
    taken, quiet_s = 0, time.monotonic()
    while time.monotonic() - quiet_s < QUIET_S:
        if (now := sum(map(len, messages.values()))) > taken:
            taken, quiet_s = now, time.monotonic()
        time.sleep(0.1)


def listed_topics(port):
    """Return the listed topics with their types, nothing while one is missing."""
    listed = {
        topic: types[0]
        for topic, types in get_topic_names_and_types(router_port=port, timeout=0.5)
        if topic.startswith("/graspsense/")
    }
    return listed if EXPECTED.items() <= listed.items() else {}


def judge_node(port):
    """List the topics of a first grasp, subscribe to them, and receive further ones."""
    asked_to_grasp(port)
    listed = wait_for(lambda: listed_topics(port), "topics")
    messages = defaultdict(list)
    for topic, type_name in listed.items():
        whole, own, used = definitions(type_name)
        type_hash = compute_type_hash_from_msg(type_name, own, used)
        info = wait_for(lambda name=topic: get_topic_info(name, router_port=port, verbose=True), topic)
        assert info.publishers[0].type_hash == type_hash, (topic, info, type_hash)
        ROS2Subscriber(topic, type_name, messages[topic].append, whole, type_hash=type_hash, router_port=port)
    # With the first of two grasps the topics and their subscriptions become known to each other.
    for _ in range(2):
        for received in messages.values():
            received.clear()
        trial = asked_to_grasp(port)
        until_quiet(messages)
    judge(trial, messages)


def main(graspsense):
    port, _router = opened_router()
    environment = {**os.environ, "ZENOH_CONFIG_OVERRIDE": f'connect/endpoints=["tcp/127.0.0.1:{port}"]'}
    process = subprocess.Popen([graspsense, *RUN], env=environment)
    try:
        judge_node(port)
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 0, process.returncode
    finally:
        process.kill()


def judge(trial, messages):
    """Compare the messages with what the program printed."""
    counts = {topic: len(message) for topic, message in messages.items()}
    sys.stdout.write(f"{counts}\n")
    assert all(counts.values()), counts
    ticks = trial["counts"]["ticks"]
    for topic in ("joint_states", "wrench/left", "wrench/right"):
        assert counts[f"/graspsense/{topic}"] == ticks, (topic, counts, ticks)
    joints = messages["/graspsense/joint_states"]
    stamps = [joint.header.stamp.sec + joint.header.stamp.nanosec * 1e-9 for joint in joints]
    assert all(later > earlier for earlier, later in pairwise(stamps))
    assert all(list(joint.name) == ["gap"] and math.isfinite(joint.position[0]) for joint in joints)
    assert max(wrench.wrench.force.z for wrench in messages["/graspsense/wrench/left"]) > 1.0
    for side in ("left", "right"):
        for image in messages[f"/graspsense/tactile/pads_{side}"]:
            assert math.prod(dim.size for dim in image.layout.dim) == len(image.data) == 22
    outcome = json.loads(messages["/graspsense/outcome"][-1].data)["outcome"]
    assert outcome == trial["outcome"], outcome
    label = json.loads(messages["/graspsense/prediction"][-1].data)["label"]
    assert label == trial["prediction"]["label"], label
    phases = {json.loads(event.data)["phase"] for event in messages["/graspsense/events"]}
    assert {"approach", "squeeze", "hold"} <= phases, phases


if __name__ == "__main__":
    main(sys.argv[1])
    sys.stdout.write("topics: every one listed and decoded\n")
    sys.stdout.flush()
    os._exit(0)
