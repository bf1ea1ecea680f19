"""Settings of a gripper behind ROS 2: what is written in the documentation, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from cases import every_case

from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.settings.selected import create
from graspsense.core.values.errors import ConfigError, NoDevice
from graspsense.gripper_api import MessageNumber, message_columns
from graspsense_ros2.message_types import encode, message
from graspsense_ros2.middleware import open_node
from graspsense_ros2.newest_messages import NewestMessage

DOCS = Path(__file__).parents[3] / "docs" / "ros2.md"


def test_the_pipeline_of_the_documentation_is_one(tmp_path):
    (text,) = re.findall(r"```toml\n(.*?)```", DOCS.read_text(), re.DOTALL)
    (tmp_path / "robot.toml").write_text(text)

    gripper = load_pipeline(tmp_path / "robot.toml").settings.gripper.create()

    assert [channel.name for channel in gripper.channels] == [
        "gap",
        "velocity",
        "force_left",
        "force_right",
        "effort",
    ]


@every_case(
    ("keys", "words"),
    [
        ({"gap": "'/joint_states.position'[0] [furlong]"}, "furlong"),
        ({"gap": "joint_states"}, "/topic.field"),
        ({"gap": "0.05"}, "no topic"),
        ({"gap": "'/j.position'[0] - first('/j.position'[0])"}, "first"),
        ({"gap": "__import__('os')"}, "function"),
        ({"left": "'/w.wrench.force.z'"}, "right"),
        ({"action": "gripper cmd"}, "action"),
        ({"position_open": 0.0}, "position_open"),
        ({"least_effort_n": 50.0}, "least_effort_n"),
    ],
)
def test_settings_that_cannot_be_are_refused(keys, words):
    with pytest.raises(ConfigError, match=re.escape(words)):
        create("sensor-backend", "ros2", **keys)


def test_a_number_is_computed_of_the_newest_messages():
    wrench = message("geometry_msgs/msg/WrenchStamped", {"wrench": {"force": {"x": 3.0, "z": -4.0}}})
    joint = message("sensor_msgs/msg/JointState", {"position": [1.0, 20.0]})
    columns = message_columns(wrench, "/wrench") | message_columns(joint, "/joint_states")

    number = MessageNumber("norm('/wrench.wrench.force.*')", "force")
    gap = MessageNumber("'/joint_states.position'[1]*2 [mm]", "gap")

    assert (number.topics, gap.topics) == ({"/wrench"}, {"/joint_states"})
    assert number.value(columns) == 5.0
    assert gap.value(columns) == pytest.approx(0.04)
    with pytest.raises(ConfigError):
        gap.value({name: np.zeros(1) for name in columns})


def joint_state(stamp_s, **positions):
    values = {"name": list(positions), "position": list(positions.values())}
    return encode("sensor_msgs/msg/JointState", {"header": {"stamp": {"sec": stamp_s}}, **values})


@every_case(
    ("gap", "expected", "ambiguous"),
    [
        # The arm has a publisher of its own on the same topic; its driver may name the joints in another order.
        ("'/joint_states.position.finger'", [None, 0.04, 0.04, 0.03, 0.02], 0),
        ("'/joint_states.position'[0]", [1.5, 1.5, 1.6, 1.6, 1.6], 3),
    ],
)
def test_a_joint_that_is_named_is_found_and_a_place_among_other_joints_is_told(gap, expected, ambiguous):
    number = MessageNumber(gap, "gap")
    newest = NewestMessage("/joint_states", "sensor_msgs/msg/JointState", number.names)
    told = []
    for data in (
        joint_state(9, shoulder=1.5),
        joint_state(2, finger=0.04),
        joint_state(10, shoulder=1.6),
        joint_state(3, finger=0.03, thumb=0.5),
        joint_state(4, thumb=0.5, finger=0.02),
    ):
        newest.take(data)
        told.append(number.value(newest.columns) if newest.came else None)
    assert told == expected
    assert (newest.ambiguous, newest.late) == (ambiguous, 0)


def test_without_a_robot_there_is_no_device(router):
    backend = create("sensor-backend", "ros2", open_timeout_s=0.2, through="zenoh")

    with pytest.raises(NoDevice, match=r"/joint_states .*ROS_DOMAIN_ID"):
        backend.open(0)


@every_case(
    ("variable", "value"),
    [
        ("ROS_DOMAIN_ID", "lab"),
        ("ROS_DOMAIN_ID", "233"),
        ("ZENOH_CONFIG_OVERRIDE", "connect/endpoints"),
        ("ZENOH_CONFIG_OVERRIDE", "connect/endpoints=5"),
        ("ZENOH_SESSION_CONFIG_URI", "/nowhere.json5"),
    ],
)
def test_an_environment_that_cannot_be_is_refused(monkeypatch, variable, value):
    monkeypatch.setenv(variable, value)

    with pytest.raises(ConfigError, match=variable.split("_")[0]):
        open_node("lost", "zenoh")


def test_rclpy_that_is_not_there_is_said():
    with pytest.raises(ConfigError, match="rclpy"):
        open_node("lost", "rclpy")
