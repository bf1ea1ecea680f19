"""A device at the outermost edge: hidapi's module and libusb's functions, in front of the emulated firmware."""

from __future__ import annotations

import math
import queue
import sys
import threading
from collections import deque
from types import ModuleType
from typing import Any

import pytest
from attrs import evolve

from graspsense.core.grasp.runner import run_grasp
from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig
from graspsense_pr2_gripper import emulation, link, opening
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import FaultConfig, Pr2Config
from graspsense_pr2_gripper.discovery import LIBRARY
from graspsense_pr2_gripper.emulator import board as emulated_boards
from graspsense_pr2_gripper.faults import Wire
from graspsense_pr2_gripper.firmware import Firmware
from graspsense_pr2_gripper.protocol import Identity
from graspsense_pr2_gripper.transports import emulated
from graspsense_pr2_gripper.transports.interface import Transport


def identity(**changes):
    """The PR2 as published: 1600/400/600 counts/N, 100 N, 0.2 m/s, 1 kHz, 41 ms, 1200 ticks a revolution."""
    numbers = {
        "firmware": (1, 2, 3), "serial": "L7", "transmission": "pr2", "pad_counts_per_n": 1600,
        "side_counts_per_n": 400, "edge_counts_per_n": 600, "effort_limit_un": 100_000_000,
        "speed_limit_um_s": 200_000, "report_rate_hz": 1000, "image_period_us": 41_000, "watchdog_ms": 100,
        "encoder_ticks_rev": 1200, "accelerometer_g": 8,
    }  # fmt: skip
    return Identity(**{**numbers, **changes})


@pytest.fixture(scope="session")
def device_identity():
    return identity


@pytest.fixture(scope="session")
def board():
    """Makes a board over a simulated gripper: `board(object="block", faults=..., serial=...)`."""

    def make(*, object="block", seed=0, faults=None, **changes):
        body = create("sensor-backend", "sim", object=object)
        body.open(seed)
        return Wire(Firmware(body, identity(**changes)), faults or FaultConfig(), seed)

    return make


@pytest.fixture(scope="session")
def near():
    """Makes an emulated gripper at a can, whose fingers stand near it: a grasp of half the ticks.

    They touch it at 1.3 s, and squeeze it until 1.6 s.
    """

    def make(faults=None, **settings):
        can = {"object": "can:empty_open", "body_config": {"open_gap_m": 0.075}}
        return Pr2Backend(
            Pr2Config(transport="emulated", faults=FaultConfig(**faults or {}), **can, **settings)
        )

    return make


@pytest.fixture(scope="session")
def grasped():
    """Makes a grasp, with the report of the gripper as it stands after closing."""

    def grasp(backend, controller="hybrid", run=None, **more):
        ended = run_grasp(backend, create("controller", controller), run or RunConfig(seed=1), **more)
        return evolve(ended, report=dict(backend.report()))

    return grasp


@pytest.fixture
def wires(monkeypatch):
    """Makes every wire of an emulated board one of this class; returns the list of them, the newest last."""

    def keep(kind):
        made = []
        monkeypatch.setattr(emulation, "Wire", lambda *given: made.append(kind(*given)) or made[-1])
        return made

    return keep


@pytest.fixture(autouse=True)
def no_thread_is_left():
    running = set(threading.enumerate())
    yield
    assert set(threading.enumerate()) - running == set()


@pytest.fixture(autouse=True)
def threads_have_time_to_end(monkeypatch):
    """Where closing waits for a thread, a busy machine gets a minute; how closing is bounded has a test of its own."""
    for module in (link, opening, emulated_boards):
        monkeypatch.setattr(module, "JOIN_S", 60.0)


@pytest.fixture
def time_stands_still(monkeypatch):
    """The driver judges no times of reports.

    A board whose time stands still between two ticks looks old on a machine that is busy.
    """
    monkeypatch.setattr(link, "OLDEST_S", math.inf)


@pytest.fixture
def answered(monkeypatch, time_stands_still):
    """A paced board goes on once its last report was answered by a command, however late: no machine is too slow.

    Neither its watchdog nor the driver's bounds on the times of reports can then tell the machine's load.
    """
    answer = threading.Event()
    on_time, transport = emulated.on_time, emulated.PacedTransport
    write, close = transport.write, transport.close

    def periods(period_s):
        for late_s in on_time(period_s):
            yield late_s
            answer.wait()
            answer.clear()

    def writes(self, report):
        try:
            write(self, report)
        finally:
            answer.set()

    def closes(self):
        self._stop = True
        answer.set()
        close(self)

    monkeypatch.setattr(emulated, "on_time", periods)
    monkeypatch.setattr(transport, "write", writes)
    monkeypatch.setattr(transport, "close", closes)


@pytest.fixture(autouse=True)
def calibrations_apart(monkeypatch, tmp_path):
    """No test reads or writes the calibrations of whoever runs it."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


class Fed(Transport):
    """A wire that hands over what a test puts in, when it puts it in."""

    def __init__(self, *reports):
        self.reports: queue.SimpleQueue[bytes | Exception] = queue.SimpleQueue()
        for report in reports:
            self.reports.put(report)
        self.longest_wait_s = 60.0
        self.closed, self.freed = threading.Event(), threading.Event()
        self.stuck_in_read = self.stuck_in_close = False

    def read(self, timeout_s):
        if self.stuck_in_read:
            self.freed.wait()
        try:
            got = self.reports.get(timeout=min(timeout_s, self.longest_wait_s))
        except queue.Empty:
            return b""
        if isinstance(got, Exception):
            raise got
        return got

    def write(self, report):
        raise NotImplementedError

    def feature(self, report_id):
        raise NotImplementedError

    def close(self):
        if self.stuck_in_close:
            self.freed.wait()
        self.closed.set()


@pytest.fixture
def fed():
    return Fed


class Machine:
    """A computer with HID sockets: a board in one of them reports when `tick` is called, or by the clock."""

    def __init__(self):
        self.plugged: dict[str, tuple[Wire, str]] = {}
        self.open_handles: list[Any] = []
        self.changed = threading.Condition()
        self.zero_timeouts = 0
        self.appear: list[tuple[int, str, Wire, str]] = []
        self.listings = 0
        self.at_endpoint: list[bytes] = []
        self.now_s = 100.0
        """The time of this machine alone: a millisecond passes with each tick."""

    def plug(self, path, wire, serial="L7"):
        self.plugged[path] = (wire, serial)

    def unplug(self, path):
        with self.changed:
            del self.plugged[path]
            self.changed.notify_all()

    def enumerate(self):
        self.listings += 1
        for listing, path, wire, serial in list(self.appear):
            if self.listings >= listing:
                self.plugged[path] = (wire, serial)
        return [
            {"vendor_id": 0x1209, "product_id": 1, "serial_number": serial, "path": path.encode()}
            for path, (_, serial) in self.plugged.items()
        ]

    def tick(self, count=1):
        with self.changed:
            for _ in range(count):
                self.now_s += 0.001
                for handle in self.open_handles:
                    if handle.path in self.plugged:
                        for report in self.plugged[handle.path][0].step():
                            if len(handle.queue) < 64:  # the kernel keeps the oldest
                                handle.queue.append(report)
            self.changed.notify_all()


class Device:
    """`hidraw.device()`."""

    def __init__(self, machine):
        self.machine = machine
        self.queue: deque[bytes] = deque()
        self.path = ""

    def open_path(self, path):
        if path.decode() not in self.machine.plugged:
            raise OSError("open failed")
        self.path = path.decode()
        self.queue.extend(self.machine.at_endpoint)
        self.machine.open_handles.append(self)

    def read(self, size, timeout_ms=0):
        if timeout_ms == 0:
            self.machine.zero_timeouts += 1  # this one blocks for good
        with self.machine.changed:
            self.machine.changed.wait_for(
                lambda: self.queue or self.path not in self.machine.plugged, timeout_ms / 1e3
            )
            if self.queue:
                return list(self.queue.popleft()[:size])
            if self.path not in self.machine.plugged:
                raise OSError("read error")
            return []

    def write(self, data):
        with self.machine.changed:
            if self.path not in self.machine.plugged:
                return -1
            self.machine.plugged[self.path][0].output(bytes(data))
            return len(data)

    def get_feature_report(self, report_id, size):
        if self.path not in self.machine.plugged:
            raise OSError("read error")
        return list(self.machine.plugged[self.path][0].firmware.feature()[:size])

    def close(self):
        if self in self.machine.open_handles:
            self.machine.open_handles.remove(self)


@pytest.fixture
def machine(monkeypatch, time_stands_still):
    made = Machine()
    module = ModuleType(LIBRARY)
    module.enumerate = made.enumerate
    module.device = lambda: Device(made)
    monkeypatch.setitem(sys.modules, LIBRARY, module)
    monkeypatch.setattr(opening, "POLL_S", 0.001)
    return made
