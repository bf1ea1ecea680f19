"""A robot with a gripper, in a process of its own: topics at 100 Hz and an action. It prints `ready`, and a line
for each goal.

python fake_robot.py KIND: KIND is GripperCommand or ParallelGripperCommand. A line of its input is a fault from now on:
silent (no wrenches), nan, wrong (bytes that are no wrench), late (stamps that fall behind), behind (messages come
a fifth of a second later), twice (each fourth joint state is the one before), refuse (goals).
"""

import json
import sys
import threading
import time
from collections import deque

from graspsense_ros2.action_server import ActionServer
from graspsense_ros2.message_types import encode
from graspsense_ros2.zenoh_node import ZenohNode

JOINT_STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
RATE_HZ = 100.0
SPEED_M_S = 0.1
OBJECT_M, STIFFNESS_N_M = 0.05, 2000.0
"""Width and stiffness of what is between the fingers."""
FALLS_BEHIND = 0.5
"""Of a late message: seconds by which its stamp falls behind in a second."""
BEHIND = 20
"""Messages by which a robot is behind, and AGAIN: each n-th message of one that sends some twice."""
AGAIN = 4


class Hand:
    """Fingers that move to a target until the object pushes back with the effort."""

    def __init__(self, kind):
        self.kind, self.fault, self.fault_s = kind, "", 0.0
        self.gap_m = self.target_m = 0.085
        self.effort_n = 0.0

    def tick(self):
        step = SPEED_M_S / RATE_HZ
        least = max(self.target_m, OBJECT_M - self.effort_n / STIFFNESS_N_M)
        self.gap_m += min(max(least - self.gap_m, -step), step)

    @property
    def force_n(self):
        return max(0.0, OBJECT_M - self.gap_m) * STIFFNESS_N_M

    def accept(self, goal):
        if self.fault == "refuse":
            return False
        command = goal.command
        if self.kind == "GripperCommand":
            self.target_m, self.effort_n = command.position, command.max_effort
        else:
            self.target_m, self.effort_n = float(command.position[0]), float(command.effort[0])
        sys.stdout.write(
            json.dumps({"gap": self.gap_m, "position": self.target_m, "effort": self.effort_n}) + "\n"
        )
        sys.stdout.flush()
        return True

    def wrench(self, stamp_s):
        force = float("nan") if self.fault == "nan" else self.force_n
        if self.fault == "wrong":
            return b"\0\1\0\0rubbish"
        return encode(WRENCH, {"header": header(stamp_s), "wrench": {"force": {"z": -force}}})


def header(stamp_s):
    return {"stamp": {"sec": int(stamp_s), "nanosec": int(stamp_s % 1.0 * 1e9)}}


def listen(hand):
    for line in sys.stdin:
        hand.fault, hand.fault_s = line.strip(), time.time()


def main(kind):
    hand, node = Hand(kind), ZenohNode("robot")
    joints = node.publisher("/joint_states", JOINT_STATE)
    wrench = node.publisher("/wrench", WRENCH)
    ActionServer(
        node,
        "/gripper_controller/gripper_cmd",
        f"control_msgs/action/{kind}",
        hand.accept,
        lambda goal: (not goal.stop.wait(5.0), {}),
    )
    threading.Thread(target=listen, args=(hand,), daemon=True).start()
    due_s = time.monotonic()
    states, wrenches, sent = deque(maxlen=BEHIND), deque(maxlen=BEHIND), 0
    while True:
        hand.tick()
        stamp_s = time.time()
        if hand.fault == "late":
            stamp_s -= FALLS_BEHIND * (stamp_s - hand.fault_s)
        state = {"name": ["finger"], "position": [hand.gap_m / 2], "effort": [hand.force_n]}
        states.append(encode(JOINT_STATE, {"header": header(time.time()), **state}))
        wrenches.append(hand.wrench(stamp_s))
        sent += 1
        behind = hand.fault == "behind"
        again = hand.fault == "twice" and sent % AGAIN == 0 and len(states) > 1
        joints(states[0] if behind else states[-2] if again else states[-1])
        if hand.fault != "silent":
            wrench(wrenches[0 if behind else -1])
        if sent == 1:
            sys.stdout.write("ready\n")
            sys.stdout.flush()
        due_s += 1.0 / RATE_HZ
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    main(sys.argv[1])
