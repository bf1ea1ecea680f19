"""A gripper that answers over TCP, and a fake server that stands for it in tests."""

import socket
import threading
import time
from contextlib import suppress
from math import inf, nan

from attrs import evolve, frozen

from graspsense.gripper_api import DeviceClock, Polling, ReadingThread
from graspsense.plugin_api import (
    NAMES_INPUT,
    NO_PADS,
    VELOCITY,
    Channel,
    Command,
    DeviceInfo,
    DeviceLost,
    Frame,
    NoDevice,
    ObjectKind,
    Reading,
    SensorBackend,
    UnknownName,
    setting,
)

RATE_HZ, OPEN_M = 50.0, 0.085
ANSWER_S = 0.05
OBJECTS = {"block": 1500.0, "sponge": 600.0}


class FakeServer:
    """A gripper that holds an object of 50 mm and this stiffness (N/m), on a free port of this machine."""

    def __init__(self, stiffness_n_m, vanishes_s, late_s):
        self._listener, self._vanishes_s = socket.create_server(("127.0.0.1", 0)), vanishes_s
        self._stiffness_n_m, self._late_s = stiffness_n_m, late_s
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        with suppress(OSError), self._listener, self._listener.accept()[0] as connection:
            lines = connection.makefile("rw")
            gap_m, speed_m_s, began_s = OPEN_M, 0.0, time.monotonic()
            last_s = began_s
            for k, line in enumerate(lines):
                now_s = time.monotonic()
                if now_s - began_s > self._vanishes_s:
                    return
                gap_m, last_s = min(max(gap_m + speed_m_s * (now_s - last_s), 0.0), OPEN_M), now_s
                force_n = self._stiffness_n_m * max(0.05 - gap_m, 0.0)
                speed_m_s, limit_n = map(float, line.split())
                if speed_m_s < 0.0 and force_n >= limit_n:
                    speed_m_s = 0.0
                lines.write(f"{now_s - began_s} {gap_m} {speed_m_s} {force_n}\n")
                time.sleep(self._late_s if k % 20 == 19 else 0.0)
                lines.flush()


@frozen(kw_only=True)
class TcpHandConfig:
    """Settings of the gripper, and of the fake that stands for it."""

    address: str = setting(default="fake", meaning="HOST:PORT of the gripper, or fake.")
    patience_s: float = setting(default=0.5, unit="s", above=0.0, meaning="How long it is asked again.")
    object: str = setting(
        default="block", effect=NAMES_INPUT, meaning="What the fake holds: block or sponge."
    )
    vanishes_s: float = setting(
        default=inf, unit="s", above=0.0, meaning="When the fake hangs up, for tests."
    )
    late_s: float = setting(
        default=0.0, unit="s", minimum=0.0, meaning="Delay of each 20th answer of the fake, for tests."
    )


class TcpHand(SensorBackend[TcpHandConfig]):
    """A gripper on a socket, with a force sensor in one finger."""

    channels = tuple(
        Channel(name, unit, RATE_HZ)
        for name, unit in (("gap", "m"), ("velocity", "m/s"), ("force_left", "N"), ("force_right", "N"))
    )
    accepts = ("velocity",)
    _reader = None

    def objects(self):
        """Return what the fake can hold; nothing for a real gripper."""
        return (
            [ObjectKind(name=name, default=True) for name in OBJECTS] if self.config.address == "fake" else ()
        )

    def with_object(self, name):
        """Return this gripper with another object in the fake."""
        return type(self)(evolve(self.config, object=name)) if self.objects() else super().with_object(name)

    def open(self, seed):
        """Connect to the gripper, or to a new fake."""
        self.close()
        fake = self._fake() if self.config.address == "fake" else None
        host, _, port = (fake.address if fake else self.config.address).rpartition(":")
        try:
            self._socket = socket.create_connection((host, int(port)), timeout=2.0)
        except (OSError, ValueError) as error:
            raise NoDevice(
                f"no hand at {self.config.address} ({error}): look at its power and network, and at gripper.address"
            ) from error
        self._socket.settimeout(ANSWER_S)
        self._received, self._command, self._last_s, self._repeated = b"", (0.0, 0.0), nan, 0
        self._clock, self._polling = DeviceClock(), Polling(RATE_HZ)
        self._reader = ReadingThread(self._answer, name="hand")
        return DeviceInfo(
            name="hand on a socket",
            clock="device",
            simulated=fake is not None,
            rate_hz=RATE_HZ,
            effort_limit_n=40.0,
            speed_limit_m_s=0.15,
            opening=Command(VELOCITY, 0.05, inf, inf),
            relaxed=Command(VELOCITY, 0.0, inf, inf),
            notes=("one finger measures force: both pads have its value",),
        )

    def read(self, timeout_s):
        """Return the next frame; None if it is not due in this time."""
        # Frames are due on a grid of times, so that the duration of an exchange does not lower the rate.
        if not self._polling.wait(timeout_s):
            return None
        until_s = time.monotonic() + self.config.patience_s
        while (answer := self._exchange()) is None:
            if time.monotonic() > until_s:
                raise DeviceLost(self._lost("no answer"))
            self._repeated += 1
        t_s, gap_m, speed_m_s, force_n = answer
        dt_s, self._last_s = (t_s - self._last_s if self._last_s == self._last_s else 1.0 / RATE_HZ), t_s
        frame = Frame(t_s, dt_s, gap_m, speed_m_s, nan, force_n, force_n, nan, nan, 0)
        return Reading(frame, NO_PADS)

    def apply(self, command):
        """Keep the command for the next exchange."""
        if self._reader is None:
            raise DeviceLost("the hand is not open")
        limit = command.speed_limit_m_s
        self._command = (min(max(command.value, -limit), limit), command.effort_limit_n)

    def close(self):
        """Stop the fingers, and close the socket."""
        reader, self._reader = self._reader, None
        if reader is not None:
            with suppress(OSError):
                self._socket.sendall(b"0 0\n")
            reader.close()
            self._socket.close()

    def report(self):
        """Return what was measured of the connection."""
        line = self._clock.line()
        return {
            "repeated": self._repeated,
            "latency_frame_s": self._clock.latency_s(),
            "clock_drift": line.drift,
            "clock_uncertainty_s": line.uncertainty_s,
        }

    def _fake(self):
        name = self.config.object.partition("#")[0]  # `block#2` is the second block
        if name not in OBJECTS:
            raise UnknownName(f"the fake has no object {name!r}: there are {', '.join(OBJECTS)}")
        return FakeServer(OBJECTS[name], self.config.vanishes_s, self.config.late_s)

    def _exchange(self):
        """Send the command and return the answer; None if it is late."""
        if self._reader is None:
            raise DeviceLost("the hand is not open")
        self._reader.newest(0.0)  # an answer that came late
        try:
            self._socket.sendall("{} {}\n".format(*self._command).encode())
        except OSError as error:
            raise DeviceLost(self._lost(error)) from error
        return self._reader.newest(ANSWER_S)

    def _answer(self):
        """Return the next answer, or None if none came for a while; in the thread."""
        try:
            while b"\n" not in self._received:
                received = self._socket.recv(4096)
                if not received:
                    raise ConnectionError("it hung up")
                self._received += received
            line, _, self._received = self._received.partition(b"\n")
            t_s, gap_m, speed_m_s, force_n = map(float, line.split())
        except TimeoutError:
            return None
        except (OSError, ValueError) as error:
            raise DeviceLost(self._lost(error)) from error
        self._clock.age_s(t_s, time.monotonic())
        return t_s, gap_m, speed_m_s, force_n

    def _lost(self, why):
        return f"the hand at {self.config.address} does not answer ({why}): look at its cable"
