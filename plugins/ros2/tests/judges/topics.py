"""zenoh-ros2-sdk lists and decodes every topic of a grasp, for an environment that has it but not graspsense.

python topics.py GRASPSENSE: GRASPSENSE is the program. The first grasp is listed, the second one is decoded.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections import defaultdict
from itertools import pairwise

from rosbags.typesys import Stores, get_typestore
from routers import opened_router
from zenoh_ros2_sdk import ROS2Subscriber, get_topic_info, get_topic_names_and_types
from zenoh_ros2_sdk.utils import compute_type_hash_from_msg

RUN = (
    *("run", "--live", "--json", "--gripper", "pr2", "--object", "odwalla:full_open", "--seed", "3"),
    *("-o", "gripper.transport=emulated", "-o", "gripper.pace=device"),
)
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


def listed(port, process):
    """Return the topics that were listed while a grasp went on, and the hash of each type."""
    types, hashes = {}, {}
    while process.poll() is None:
        for topic, names in get_topic_names_and_types(router_port=port, timeout=0.2):
            if topic not in types:
                (types[topic],) = names
                info = get_topic_info(topic, router_port=port, timeout=0.2, verbose=True)
                if info is not None and info.publishers:
                    hashes[topic] = info.publishers[0].type_hash
                else:
                    del types[topic]
    return types, hashes


def main(graspsense):
    port, _router = opened_router()
    environment = {**os.environ, "ZENOH_CONFIG_OVERRIDE": f'connect/endpoints=["tcp/127.0.0.1:{port}"]'}
    process = subprocess.Popen([graspsense, *RUN], env=environment, stdout=subprocess.DEVNULL)
    types, hashes = listed(port, process)
    assert process.returncode == 0, process.returncode
    missing = EXPECTED.items() - types.items()
    # The outcome is published in the last moment of the process, which the listing may miss.
    assert {topic for topic, _ in missing} <= {"/graspsense/outcome"}, missing
    messages = defaultdict(list)
    for topic, type_name in EXPECTED.items():
        whole, own, used = definitions(type_name)
        type_hash = compute_type_hash_from_msg(type_name, own, used)
        assert hashes.get(topic, type_hash) == type_hash, (topic, hashes[topic], type_hash)
        ROS2Subscriber(topic, type_name, messages[topic].append, whole, type_hash=type_hash, router_port=port)
    done = subprocess.run([graspsense, *RUN], env=environment, capture_output=True, text=True, check=True)
    time.sleep(1.0)
    judge(json.loads(done.stdout), done.stderr, messages)


def judge(trial, said, messages):
    """Compare the messages with what the program printed."""
    assert "could not follow" not in said, said
    counts = {topic: len(messages[topic]) for topic in EXPECTED}
    sys.stdout.write(f"{counts}\n")
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
