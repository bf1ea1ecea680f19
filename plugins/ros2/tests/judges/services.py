"""zenoh-ros2-sdk lists our services, asks for a grasp, and moves the gripper by the services and topics of its action.

python services.py GRASPSENSE: GRASPSENSE is the program. The definitions below are the fields of the messages on
the wire, one after the other, so that what they decode does not depend on our types.
"""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
from routers import opened_router
from zenoh_ros2_sdk import (
    ROS2ServiceClient,
    ROS2Subscriber,
    get_service_info,
    get_service_names_and_types,
    get_topic_info,
)

RUN = ("ros2", "--grasp", "--action", "--pipeline", "robotiq", "-o", "gripper.port=emulated")
GRASP, ACTION = "/graspsense/grasp", "/graspsense/gripper_cmd/_action"
EXPECTED = {
    GRASP: "std_srvs/srv/Trigger",
    f"{ACTION}/send_goal": "control_msgs/action/GripperCommand_SendGoal",
    f"{ACTION}/get_result": "control_msgs/action/GripperCommand_GetResult",
    f"{ACTION}/cancel_goal": "action_msgs/srv/CancelGoal",
}
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
"""The hash that nodes of ROS 2 announce for std_srvs/srv/Trigger."""
STATE = "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal\n"
FIELDS = {
    GRASP: ("uint8 structure_needs_at_least_one_member", "bool success\nstring message"),
    f"{ACTION}/send_goal": (
        "uint8[16] goal_id\nfloat64 position\nfloat64 max_effort",
        "bool accepted\nint32 sec\nuint32 nanosec",
    ),
    f"{ACTION}/get_result": ("uint8[16] goal_id", f"int8 status\n{STATE}"),
}
SUCCEEDED = 4


def wait_for_services(port, process):
    """Wait until all services are listed, several times in a row: the tokens come one after the other."""
    until, in_a_row, services = time.monotonic() + 60.0, 0, {}
    while in_a_row < 5:
        assert process.poll() is None, process.returncode
        assert time.monotonic() < until, services
        services = {
            name: types[0] for name, types in get_service_names_and_types(router_port=port, timeout=0.5)
        }
        in_a_row = in_a_row + 1 if services == EXPECTED else 0
        time.sleep(0.2)


def listed(look):
    """Return what this finds; on a slow machine, the time to list is over before the answers come."""
    until = time.monotonic() + 60.0
    while (info := look()) is None:
        assert time.monotonic() < until
    return info


def client(port, service):
    info = listed(lambda: get_service_info(service, router_port=port, timeout=1.0, verbose=True))
    request, response = FIELDS[service]
    return ROS2ServiceClient(
        service,
        EXPECTED[service],
        request_definition=request,
        response_definition=response,
        type_hash=info.servers[0].type_hash,
        router_port=port,
        timeout=60.0,
    )


def judge(port):
    trigger = listed(lambda: get_service_info(GRASP, router_port=port, timeout=1.0, verbose=True))
    assert trigger.servers[0].type_hash == TRIGGER_HASH, trigger

    feedback = []
    topic = f"{ACTION}/feedback"
    info = listed(lambda: get_topic_info(topic, router_port=port, timeout=1.0, verbose=True))
    (type_name,) = info.topic_types
    ROS2Subscriber(
        topic,
        type_name,
        feedback.append,
        f"uint8[16] goal_id\n{STATE}",
        type_hash=info.publishers[0].type_hash,
        router_port=port,
    )
    goal_id = np.arange(16, dtype=np.uint8)
    sent = client(port, f"{ACTION}/send_goal").call(goal_id=goal_id, position=0.03, max_effort=30.0)
    assert sent.accepted, sent
    result = client(port, f"{ACTION}/get_result").call(goal_id=goal_id)
    assert result.status == SUCCEEDED, result
    assert result.reached_goal or result.stalled, result
    assert feedback, "no feedback"
    assert list(feedback[0].goal_id) == list(range(16)), feedback[0]
    assert 0.02 < result.position < 0.085, result

    grasped = client(port, GRASP).call(structure_needs_at_least_one_member=0)
    assert grasped.success, grasped
    told = json.loads(grasped.message)
    assert told["outcome"], told
    sys.stdout.write(
        f"services: {len(EXPECTED)}, {len(feedback)} times feedback, {result}, {told['outcome']}\n"
    )


def main(graspsense):
    port, _router = opened_router()
    environment = {**os.environ, "ZENOH_CONFIG_OVERRIDE": f'connect/endpoints=["tcp/127.0.0.1:{port}"]'}
    process = subprocess.Popen([graspsense, *RUN], env=environment)
    try:
        wait_for_services(port, process)
        judge(port)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0, process.returncode
    finally:
        process.kill()


if __name__ == "__main__":
    main(sys.argv[1])
    sys.stdout.flush()
    os._exit(0)
