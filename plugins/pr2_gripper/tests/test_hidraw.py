"""The driver over hidapi, with a module in hidapi's place that behaves as the real one was seen to.

What it does was observed on a Linux kernel with hidapi 0.15: see the table "What each library really does" in
docs/pr2.md.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import deque
from types import ModuleType
from typing import Any

import pytest

from graspsense.plugin_api import EFFORT, Command, DeviceLost, NoDevice
from graspsense_pr2_gripper import opening
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import FaultConfig, Pr2Config
from graspsense_pr2_gripper.discovery import LIBRARY
from graspsense_pr2_gripper.faults import Wire

RELAX = Command(EFFORT, 0.0, float("inf"), float("inf"))


class Machine:
    """A computer with HID sockets: a board in one of them reports when `tick` is called, or by the clock."""

    def __init__(self) -> None:
        self.plugged: dict[str, tuple[Wire, str]] = {}
        self.open_handles: list[Any] = []
        self.changed = threading.Condition()
        self.zero_timeouts = 0
        self.appear: list[tuple[int, str, Wire, str]] = []
        self.listings = 0

    def plug(self, path: str, wire: Wire, serial: str = "L7") -> None:
        self.plugged[path] = (wire, serial)

    def unplug(self, path: str) -> None:
        with self.changed:
            del self.plugged[path]
            self.changed.notify_all()

    def enumerate(self) -> list[dict[str, Any]]:
        self.listings += 1
        for at, path, wire, serial in list(self.appear):
            if self.listings >= at:
                self.plugged[path] = (wire, serial)
        return [
            {"vendor_id": 0x1209, "product_id": 1, "serial_number": serial, "path": path.encode()}
            for path, (_, serial) in self.plugged.items()
        ]

    def tick(self, count: int = 1) -> None:
        with self.changed:
            for _ in range(count):
                for handle in self.open_handles:
                    if handle.path in self.plugged:
                        for report in self.plugged[handle.path][0].step():
                            if len(handle.queue) < 64:  # the kernel keeps the oldest
                                handle.queue.append(report)
            self.changed.notify_all()


class Device:
    """`hidraw.device()`."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.queue: deque[bytes] = deque()
        self.path = ""

    def open_path(self, path: bytes) -> None:
        if path.decode() not in self.machine.plugged:
            raise OSError("open failed")
        self.path = path.decode()
        self.machine.open_handles.append(self)

    def read(self, size: int, timeout_ms: int = 0) -> list[int]:
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

    def write(self, data: bytes) -> int:
        with self.machine.changed:
            if self.path not in self.machine.plugged:
                return -1
            self.machine.plugged[self.path][0].output(bytes(data))
            return len(data)

    def get_feature_report(self, report_id: int, size: int) -> list[int]:
        if self.path not in self.machine.plugged:
            raise OSError("read error")
        return list(self.machine.plugged[self.path][0].firmware.feature()[:size])

    def close(self) -> None:
        if self in self.machine.open_handles:
            self.machine.open_handles.remove(self)


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    made = Machine()
    module = ModuleType(LIBRARY)
    module.enumerate = made.enumerate  # type: ignore[attr-defined]
    module.device = lambda: Device(made)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, LIBRARY, module)
    monkeypatch.setattr(opening, "POLL_S", 0.001)
    return made


@pytest.fixture
def opened(machine: Machine, board: Any) -> Any:
    machine.plug("/dev/hidraw3", board())
    backend = Pr2Backend(Pr2Config())
    backend.open(0)
    yield backend
    backend.close()


def following(backend: Pr2Backend, machine: Machine) -> Any:
    """Let a millisecond pass, and wait for what the reader makes of it."""
    machine.tick()
    return backend.read(10.0)


def test_device_says_who_it_is(machine: Machine, board: Any) -> None:
    machine.plug("/dev/hidraw3", board(effort_limit_un=50_000_000))
    backend = Pr2Backend(Pr2Config())
    info = backend.open(0)
    backend.close()
    assert (info.serial, info.firmware, info.clock, info.rate_hz) == ("L7", "1.2.3", "device", 1000.0)
    assert (info.effort_limit_n, info.speed_limit_m_s) == (50.0, 0.2)
    assert any("private tests" in note for note in info.notes)


def test_frames_come_and_commands_arrive(opened: Pr2Backend, machine: Machine) -> None:
    first = following(opened, machine)
    assert first.frame.t_s == 0.0
    assert first.frame.gap_m == pytest.approx(0.086, abs=1e-6)
    opened.apply(Command(EFFORT, 12.5, float("inf"), float("inf")))
    assert following(opened, machine).frame.effort_n == 12.5


def test_no_read_has_a_timeout_of_zero_which_would_block(opened: Pr2Backend, machine: Machine) -> None:
    for _ in range(20):
        following(opened, machine)
    assert machine.zero_timeouts == 0


def test_pulled_cable_ends_a_read_at_once(opened: Pr2Backend, machine: Machine) -> None:
    following(opened, machine)
    machine.unplug("/dev/hidraw3")
    with pytest.raises(DeviceLost, match="read error"):
        opened.read(10.0)


def test_write_that_returns_minus_one_is_a_loss(opened: Pr2Backend, machine: Machine) -> None:
    following(opened, machine)
    machine.unplug("/dev/hidraw3")
    with pytest.raises(DeviceLost, match="-1 of 64 bytes"):
        opened.apply(RELAX)


def test_silence_is_no_frame_but_no_loss_yet(opened: Pr2Backend, machine: Machine) -> None:
    assert opened.read(0.01) is None
    assert following(opened, machine) is not None


def test_writes_that_never_arrive_are_noticed_by_their_echo(machine: Machine, board: Any) -> None:
    """uhid took 200 writes and dropped up to 76 of them in silence."""
    machine.plug("/dev/hidraw3", board(faults=FaultConfig(drop_command=1.0)))
    backend = Pr2Backend(Pr2Config())
    backend.open(0)

    def commanding() -> None:
        for _ in range(200):
            following(backend, machine)
            backend.apply(RELAX)

    with pytest.raises(DeviceLost, match="takes no commands"):
        commanding()
    backend.close()


def test_closing_tells_the_gripper_to_let_go(machine: Machine, board: Any) -> None:
    wire = board()
    machine.plug("/dev/hidraw3", wire)
    backend = Pr2Backend(Pr2Config())
    backend.open(0)
    following(backend, machine)
    backend.apply(Command(EFFORT, 20.0, float("inf"), float("inf")))
    assert wire.firmware.effort_un == 20_000_000
    backend.close()
    assert wire.firmware.effort_un == 0
    assert machine.open_handles == []


def test_same_gripper_is_found_again_by_its_serial_at_another_path(machine: Machine, board: Any) -> None:
    machine.plug("/dev/hidraw3", board())
    backend = Pr2Backend(Pr2Config())
    backend.open(0)
    following(backend, machine)
    machine.unplug("/dev/hidraw3")
    with pytest.raises(DeviceLost):
        backend.read(10.0)
    backend.close()
    # First another gripper appears in its place, then ours elsewhere.
    machine.plug("/dev/hidraw3", board(serial="R2"), "R2")
    machine.appear.append((machine.listings + 4, "/dev/hidraw9", board(), "L7"))
    info = backend.open(0)
    assert info.serial == "L7"
    assert machine.open_handles[0].path == "/dev/hidraw9"
    assert following(backend, machine).frame.t_s == 0.0
    backend.close()


def test_waiting_for_a_lost_gripper_ends(machine: Machine, board: Any) -> None:
    machine.plug("/dev/hidraw3", board())
    backend = Pr2Backend(Pr2Config(reconnect_s=0.01))
    backend.open(0)
    machine.unplug("/dev/hidraw3")
    with pytest.raises(DeviceLost):
        backend.read(10.0)
    with pytest.raises(NoDevice, match="with serial number 'L7'"):
        backend.open(0)


def test_first_opening_does_not_wait(machine: Machine) -> None:
    began = time.monotonic()
    with pytest.raises(NoDevice):
        Pr2Backend(Pr2Config(reconnect_s=3600.0)).open(0)
    assert time.monotonic() - began < 600.0
    assert machine.listings == 1


def test_mouse_under_our_numbers_is_not_driven(machine: Machine, board: Any) -> None:
    wire = board()
    wire.firmware.feature = lambda: bytes(64)
    machine.plug("/dev/hidraw3", wire)
    with pytest.raises(NoDevice, match="is no PR2 gripper to this driver: wrong CRC"):
        Pr2Backend(Pr2Config()).open(0)
    assert machine.open_handles == []


def test_serial_of_the_usb_string_must_be_the_boards_own(machine: Machine, board: Any) -> None:
    machine.plug("/dev/hidraw3", board(serial="R2"), "L7")
    with pytest.raises(NoDevice, match="'R2', asked for is 'L7'"):
        Pr2Backend(Pr2Config(serial="L7")).open(0)
