"""Types of ROS 2: hashes that others computed, and messages that are damaged."""

from contextlib import suppress

import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense_ros2.message_types import BadMessage, decode, encode, hash_of, typestore

PUBLISHED = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "action_msgs/srv/CancelGoal": "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
    "action_msgs/msg/GoalStatusArray": "6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
}
"""Hashes that nodes of ROS 2 announce: of messages, and of services with their events."""
FIBONACCI = "example_interfaces/action/Fibonacci"
OF_AN_ACTION = {
    f"{FIBONACCI}_SendGoal": "d1a57fb2a4afe8c21e34fb10db206f16ce6729b28531141472df92277c55b557",
    f"{FIBONACCI}_GetResult": "1b0de0d5d29dc955d92f546706568428632771db13ec84c15ec1c1a59f424a57",
    f"{FIBONACCI}_FeedbackMessage": "c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2",
}
"""Hashes that nodes of ROS 2 announce for the parts of an action."""
GOAL = "control_msgs/action/GripperCommand_SendGoal_Request"


@every_case("name", PUBLISHED)
def test_hashes_are_those_of_ros(name):
    assert hash_of(name) == f"RIHS01_{PUBLISHED[name]}"


def test_the_parts_of_an_action_are_derived_as_ros_derives_them():
    store = typestore({}, {FIBONACCI: ("int32 order", "int32[] sequence", "int32[] sequence")})

    assert {name: store.hash_rihs01(name) for name in OF_AN_ACTION} == {
        name: f"RIHS01_{digest}" for name, digest in OF_AN_ACTION.items()
    }


def test_a_goal_is_written_and_read():
    data = encode(
        GOAL, {"goal_id": {"uuid": range(16)}, "goal": {"command": {"position": 0.03, "max_effort": 12.0}}}
    )

    goal = decode(GOAL, data)

    assert list(goal.goal_id.uuid) == list(range(16))
    assert (goal.goal.command.position, goal.goal.command.max_effort) == (0.03, 12.0)


def test_an_empty_request_has_the_byte_that_idl_demands():
    assert encode("std_srvs/srv/Trigger_Request", {}) == b"\0\1\0\0\0"


@pytest.mark.parametrize("name", ["sensor_msgs/msg/JointState", GOAL, "std_msgs/msg/Float64MultiArray"])
@given(data=st.binary(max_size=200))
def test_bytes_that_are_no_message_are_refused(name, data):
    for head in (b"", b"\0\1\0\0"):
        with suppress(BadMessage):
            assert decode(name, head + data).__msgtype__ == name


@pytest.mark.parametrize("values", [{"position": "wide"}, {"joints": []}, {"name": 5}])
def test_values_that_do_not_fit_are_refused(values):
    with pytest.raises(BadMessage):
        encode("sensor_msgs/msg/JointState", values)
