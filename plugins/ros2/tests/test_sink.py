"""Grasps as topics: what a node of others receives."""

import json
import math
import threading
import time
from collections import defaultdict

import pytest

from graspsense_ros2.message_types import decode
from graspsense_ros2.sink import ARRAY, JOINT_STATE, NUMBER, TEXT, WRENCH, publish_grasps
from graspsense_ros2.zenoh_node import ZenohNode

PATIENCE_S = 120.0
ATTEMPTS = 40
CHANNELS = [
    {"name": "gap", "kind": "number"},
    {"name": "pads", "kind": "array", "rows": 2, "columns": 3, "components": 1},
    {"name": "skin", "kind": "array", "rows": 1, "columns": 2, "components": 3},
    {"name": "sound", "kind": "fast"},
]


def ticks(*t_s, left=math.nan):
    numbers = len(t_s)
    return {
        "kind": "ticks",
        "t_s": list(t_s),
        "gap_m": [0.05 - t for t in t_s],
        "velocity_m_s": [-1.0] * numbers,
        "effort_n": [4.0] * numbers,
        "force_left_n": [left] * numbers,
        "force_right_n": [math.nan] * numbers,
    }


GRASP = [
    [{"kind": "grasp", "channels": CHANNELS}],
    [
        ticks(0.0, 0.001, left=7.5),
        {"kind": "scalars", "t_s": [0.0, 0.001], "heat": [300.0, 301.0]},
        {
            "kind": "image",
            "name": "pads_left",
            "t_s": 0.0,
            "counter": 1,
            "cells": [1.0, 2.0, 3.0, 4.0, 5.0, 6.0],
        },
        {
            "kind": "image",
            "name": "skin",
            "t_s": 0.0,
            "counter": 1,
            "cells": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
        },
        {
            "kind": "samples",
            "name": "sound",
            "t_s": [0.0],
            "counter": [2],
            "values": [[[1.0, -1.0], [2.0, -2.0]]],
        },
        {"kind": "event", "t_s": 0.0, "phase": "squeeze", "what": "contact", "source": "controller"},
    ],
    [ticks(0.002), {"kind": "progress", "text": "1 of 2"}],
    [{"kind": "outcome", "outcome": "steady", "reason": ""}],
]
TYPES = {
    "joint_states": JOINT_STATE,
    "wrench/left": WRENCH,
    "wrench/right": WRENCH,
    "signals/heat": NUMBER,
    "signals/sound": ARRAY,
    "tactile/pads_left": ARRAY,
    "tactile/skin": ARRAY,
    "events": TEXT,
    "outcome": TEXT,
}


@pytest.fixture
def received(router):
    """The messages of each topic of the grasp, as another node gets them."""
    node, other = ZenohNode("graspsense"), ZenohNode("listener")
    messages, ended = defaultdict(list), threading.Event()

    def take(topic, type_name, data):
        messages[topic].append(decode(type_name, data))
        if topic == "outcome":
            ended.set()

    for topic, type_name in TYPES.items():
        other.subscribe(
            f"/graspsense/{topic}", type_name, lambda data, kind=(topic, type_name): take(*kind, data)
        )
    try:
        # What is published before the router has told of the subscriptions reaches nobody.
        for _ in range(ATTEMPTS):
            messages.clear()
            ended.clear()
            publish_grasps(node, GRASP)
            if ended.wait(PATIENCE_S / ATTEMPTS) and len(messages["joint_states"]) == 3:
                break
    finally:
        node.close()
        other.close()
    return messages


def dimensions(message):
    return [(dim.label, dim.size, dim.stride) for dim in message.layout.dim]


def test_a_grasp_arrives_as_topics(received):
    joints = received["joint_states"]
    assert [joint.position[0] for joint in joints] == [0.05, 0.049, 0.048]
    assert [(joint.name, joint.velocity[0], joint.effort[0]) for joint in joints] == [
        (["gap"], -1.0, 4.0)
    ] * 3
    stamps = [joint.header.stamp.sec + joint.header.stamp.nanosec * 1e-9 for joint in joints]
    assert abs(stamps[0] - time.time()) < 2 * PATIENCE_S
    assert stamps[2] - stamps[0] == pytest.approx(0.002, abs=1e-6)
    # A pad that measures nothing has no message.
    assert [wrench.wrench.force.z for wrench in received["wrench/left"]] == [7.5, 7.5]
    assert not received["wrench/right"]
    assert [number.data for number in received["signals/heat"]] == [300.0, 301.0]
    assert json.loads(received["events"][0].data)["what"] == "contact"
    assert json.loads(received["outcome"][0].data) == {"outcome": "steady", "reason": ""}
    # Arrays say their shape.
    (pads,), (skin,), (sound,) = (received[f] for f in ("tactile/pads_left", "tactile/skin", "signals/sound"))
    assert dimensions(pads) == [("rows", 2, 6), ("columns", 3, 3)]
    assert list(pads.data) == [1, 2, 3, 4, 5, 6]
    assert dimensions(skin) == [("rows", 1, 6), ("columns", 2, 6), ("components", 3, 3)]
    assert list(skin.data) == [1, 2, 3, 4, 5, 6]
    assert dimensions(sound) == [("samples", 2, 4), ("axes", 2, 2)]
    assert list(sound.data) == [1, -1, 2, -2]
