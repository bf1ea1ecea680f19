"""The fake robot as a process, the settings of its gripper, and graspsense in step with it.

python robots.py PORT WORD...: `graspsense WORD...`, in step with the robot of this port.
"""

import json
import socket
import subprocess
import sys
import threading
import time
import zlib
from contextlib import suppress
from pathlib import Path

from fake_robot import RATE_HZ

from graspsense_ros2.action_client import GripperAction
from graspsense_ros2.backend import Ros2Backend
from graspsense_ros2.newest_messages import NewestMessage

ROBOT = Path(__file__).with_name("fake_robot.py")
STEPPED = __file__
"""The program that runs graspsense in step with a robot."""
OPTIONS = (
    "gripper.type=ros2",
    "gripper.gap='/joint_states.position'[0]*2",
    "gripper.left=-'/wrench.wrench.force.z'",
    "gripper.right=-'/wrench.wrench.force.z'",
    "gripper.through=zenoh",
    "gripper.delay_s=0.1",
    "controller.step_time_s=0.1",
    "gripper.open_timeout_s=100",
    "controller.type=send-and-watch",
    "controller.probing_force_n=15",
    "classifier.type=none",
)


PATIENCE_S = 300.0
"""What a test waits for comes within this time, or not at all."""
UNKNOWN_S = 0.02
"""So long a tick waits for a topic of which nothing came yet: the robot may not know yet who listens."""
AGAIN_S = 1.0
"""After so long a message that did not come is sent again."""


class Line:
    """A connection to the robot."""

    def __init__(self, port):
        with socket.create_connection(("127.0.0.1", port)) as connection:
            self._lines = connection.makefile("rw")

    def close(self):
        with suppress(OSError):
            self._lines.close()

    def asked(self, word):
        """Return the answer of the robot; empty where it is dead."""
        try:
            self._lines.write(f"{word}\n")
            self._lines.flush()
            return json.loads(self._lines.readline())
        except (OSError, ValueError):
            return {}


class InStep:
    """The time of a gripper whose robot waits for it.

    A sleep lets as many ticks of the robot pass, and ends once their messages have come. A goal is answered before the
    next tick. Without the robot the time passes by itself.
    """

    def __init__(self, line):
        self._robot = line
        self._ticks, self._taken, self._changed = 0, {}, threading.Condition()

    def monotonic(self):
        return self._ticks / RATE_HZ

    def sleep(self, seconds):
        ticks = round(seconds * RATE_HZ)
        carried = self._robot.asked(ticks) if ticks else {}
        self._ticks += ticks
        until = time.monotonic() + PATIENCE_S
        while not self._came(carried):
            assert time.monotonic() < until
            self._robot.asked("again")

    def _came(self, carried):
        """Return whether these messages came, of topics of which there was one before."""
        with self._changed:
            came = self._changed.wait_for(
                lambda: all(crc in self._taken.get(topic, ()) for topic, crc in carried.items()),
                AGAIN_S if self._taken.keys() >= carried.keys() else UNKNOWN_S,
            )
            return came or not self._taken.keys() >= carried.keys()

    def install(self, setattr=setattr):
        """Let each gripper behind ROS 2 have this time."""
        take, want, opened = NewestMessage.take, GripperAction.want, Ros2Backend.open

        def open_anew(backend, seed):
            self._taken = {}
            return opened(backend, seed)

        def taken(newest, data):
            take(newest, data)
            with self._changed:
                self._taken.setdefault(newest.topic, set()).add(zlib.crc32(data))
                self._changed.notify_all()

        def answered(action, target):
            counts = action.goals, action.failures
            want(action, target)
            with self._changed:
                while (action.goals, action.failures) == counts:
                    self._changed.wait(0.001)

        setattr(Ros2Backend, "clock", self)
        setattr(Ros2Backend, "open", open_anew)
        setattr(NewestMessage, "take", taken)
        setattr(GripperAction, "want", answered)


class Robot:
    """The robot's process, once it publishes: its faults, and the goals that it was sent."""

    def __init__(self, kind):
        self.process = subprocess.Popen([sys.executable, str(ROBOT), kind], stdout=subprocess.PIPE, text=True)
        self.port = int(self.process.stdout.readline())
        self.line = Line(self.port)

    def fault(self, name):
        self.line.asked(name)

    def goals(self):
        return self.line.asked("goals")

    def end(self):
        self.process.kill()
        self.process.communicate()
        self.line.close()


if __name__ == "__main__":
    from graspsense.cli.main import main

    InStep(Line(int(sys.argv[1]))).install()
    sys.exit(main(sys.argv[2:]))
