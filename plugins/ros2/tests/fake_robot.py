"""A robot with a gripper, in a process of its own: topics at 100 Hz of its own time, and an action.

python fake_robot.py KIND: KIND is GripperCommand or ParallelGripperCommand. Its time stands still until somebody lets
it pass: a client of the port of loopback that it prints asks for a number of ticks, and is answered with the topics of
the last one and what they carried (a CRC, which is missing for a topic that was silent). So nobody loses a frame,
however long a machine is held up. The network may lose a message while nodes find each other: `again` publishes the
last ones once more. A client that asks for `goals` is answered with the goals that were accepted. Any other word is a
fault from now on: silent (no wrenches), nan, wrong (bytes that are no wrench), late (stamps that fall behind), behind
(messages come a fifth of a second later), twice (each fourth joint state is the one before), refuse (goals).
"""

import json
import socketserver
import sys
import threading
import zlib
from collections import deque

from graspsense_ros2.action_server import ActionServer
from graspsense_ros2.message_types import encode
from graspsense_ros2.zenoh_node import ZenohNode

JOINT_STATE, WRENCH = "sensor_msgs/msg/JointState", "geometry_msgs/msg/WrenchStamped"
RATE_HZ = 100
START_S = 1000.0
"""The time of its first tick; a stamp of 0 is none."""
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
        self.kind, self.goals = kind, []
        self.gap_m = self.target_m = 0.085
        self.effort_n = 0.0

    def tick(self):
        step = SPEED_M_S / RATE_HZ
        least = max(self.target_m, OBJECT_M - self.effort_n / STIFFNESS_N_M)
        self.gap_m += min(max(least - self.gap_m, -step), step)

    @property
    def force_n(self):
        return max(0.0, OBJECT_M - self.gap_m) * STIFFNESS_N_M

    def take(self, goal):
        command = goal.command
        if self.kind == "GripperCommand":
            self.target_m, self.effort_n = command.position, command.max_effort
        else:
            self.target_m, self.effort_n = float(command.position[0]), float(command.effort[0])
        self.goals.append({"gap": self.gap_m, "position": self.target_m, "effort": self.effort_n})


class Robot:
    """The hand with its topics and its action."""

    def __init__(self, kind):
        self.hand, self.node = Hand(kind), ZenohNode("robot")
        self.fault, self.fault_tick, self.ticks, self.carried = "", 0, 0, {}
        self.lock = threading.Lock()
        self.states, self.wrenches = deque(maxlen=BEHIND), deque(maxlen=BEHIND)
        self.publish = {
            "/joint_states": self.node.publisher("/joint_states", JOINT_STATE),
            "/wrench": self.node.publisher("/wrench", WRENCH),
        }
        ActionServer(
            self.node,
            "/gripper_controller/gripper_cmd",
            f"control_msgs/action/{kind}",
            self.accept,
            lambda goal: (not goal.stop.wait(5.0), {}),
        )

    def accept(self, goal):
        with self.lock:
            if self.fault != "refuse":
                self.hand.take(goal)
            return self.fault != "refuse"

    def answer(self, word):
        """Do what a client asks for, and return the answer."""
        with self.lock:
            if word == "goals":
                return self.hand.goals
            if word == "again":
                return self.carry()
            if word.isdecimal():
                return [self.tick() for _ in range(int(word))][-1]
            self.fault, self.fault_tick = word, self.ticks
            return word

    def tick(self):
        """Let a tick pass, and return the CRC of what each topic carried."""
        self.hand.tick()
        self.ticks += 1
        behind = self.fault == "behind"
        again = self.fault == "twice" and self.ticks % AGAIN == 0 and len(self.states) > 0
        joints = {"name": ["finger"], "position": [self.hand.gap_m / 2], "effort": [self.hand.force_n]}
        self.states.append(encode(JOINT_STATE, {"header": self.header(), **joints}))
        self.wrenches.append(self.wrench())
        if behind and self.ticks - self.fault_tick < BEHIND:
            return {}
        self.carried = {"/joint_states": self.states[0 if behind else -2 if again else -1]}
        if self.fault != "silent":
            self.carried["/wrench"] = self.wrenches[0 if behind else -1]
        return self.carry()

    def carry(self):
        for topic, data in self.carried.items():
            self.publish[topic](data)
        return {topic: zlib.crc32(data) for topic, data in self.carried.items()}

    def wrench(self):
        if self.fault == "wrong":
            return b"\0\1\0\0rubbish"
        force = float("nan") if self.fault == "nan" else self.hand.force_n
        late = self.fault == "late"
        ticks_late = FALLS_BEHIND * (self.ticks - self.fault_tick) if late else 0.0
        return encode(WRENCH, {"header": self.header(ticks_late), "wrench": {"force": {"z": -force}}})

    def header(self, ticks_late=0.0):
        stamp_s = START_S + (self.ticks - ticks_late) / RATE_HZ
        return {"stamp": {"sec": int(stamp_s), "nanosec": int(stamp_s % 1.0 * 1e9)}}


class Client(socketserver.StreamRequestHandler):
    """Answers a client of the robot, a line each."""

    def handle(self):
        for line in self.rfile:
            answer = self.server.robot.answer(line.decode().strip())
            self.wfile.write(json.dumps(answer).encode() + b"\n")


def main(kind):
    server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Client)
    server.daemon_threads, server.robot = True, Robot(kind)
    sys.stdout.write(f"{server.server_address[1]}\n")
    sys.stdout.flush()
    server.serve_forever()


if __name__ == "__main__":
    main(sys.argv[1])
