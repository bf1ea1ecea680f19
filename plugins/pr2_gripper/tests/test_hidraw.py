"""The driver over hidapi, with a module in hidapi's place that behaves as the real one was seen to.

What it does was observed on a Linux kernel with hidapi 0.15: see the table "Observed behaviour of the libraries"
in benchmarks/results/pr2.md.
"""

import threading
import time
from contextlib import closing

import pytest

from graspsense.plugin_api import EFFORT, Command, DeviceLost, NoDevice
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import FaultConfig, Pr2Config

RELAX = Command(EFFORT, 0.0, float("inf"), float("inf"))


def plugged_in(machine, wire, **settings):
    """Plug a board into a socket and open it."""
    machine.plug("/dev/hidraw3", wire)
    backend = Pr2Backend(Pr2Config(**settings))
    backend.open(0)
    return backend


@pytest.fixture
def opened(machine, board):
    backend = plugged_in(machine, board())
    yield backend
    backend.close()


def following(backend, machine):
    """Let a millisecond pass, and wait for what the reader makes of it."""
    machine.tick()
    return backend.read(60.0)


def test_device_says_who_it_is(machine, board):
    machine.plug("/dev/hidraw3", board(effort_limit_un=50_000_000, speed_limit_um_s=100_000))
    with closing(Pr2Backend(Pr2Config())) as backend:
        info = backend.open(0)
    assert (info.serial, info.firmware, info.clock, info.rate_hz) == ("L7", "1.2.3", "device", 1000.0)
    assert (info.effort_limit_n, info.speed_limit_m_s) == (50.0, 0.1)
    assert any("private tests" in note for note in info.notes)


def test_frames_come_and_commands_arrive(opened, machine):
    assert opened.read(0.01) is None, "silence is no loss yet"
    opening = following(opened, machine)
    assert opening.frame.t_s == 0.0
    assert opening.frame.gap_m == pytest.approx(0.086, abs=1e-6)
    opened.apply(Command(EFFORT, 12.5, float("inf"), float("inf")))
    assert [following(opened, machine).frame.effort_n for _ in range(20)] == [12.5] * 20
    assert machine.zero_timeouts == 0, "a read with a time-out of zero would block"


@pytest.mark.parametrize(
    ("use", "says"),
    [
        (lambda opened: opened.read(60.0), "read error"),
        (lambda opened: opened.apply(RELAX), "-1 of 64 bytes"),
    ],
    ids=["read", "write"],
)
def test_pulled_cable_is_a_loss_at_once(opened, machine, use, says):
    following(opened, machine)
    machine.unplug("/dev/hidraw3")
    with pytest.raises(DeviceLost, match=says):
        use(opened)


def test_a_stalled_write_is_a_loss_within_a_second(opened, machine, monkeypatch):
    """The kernel waits for 5 s where an endpoint is stalled, and nothing interrupts it."""
    following(opened, machine)
    stalled = threading.Event()
    monkeypatch.setattr(type(machine.open_handles[0]), "write", lambda self, data: stalled.wait(60.0) and -1)
    began = time.monotonic()
    with pytest.raises(DeviceLost, match=r"/dev/hidraw3.*0\.25 s"):
        opened.apply(RELAX)
    assert time.monotonic() - began < 30.0  # not the minute that the write takes
    stalled.set()


def test_writes_that_never_arrive_are_noticed_by_their_echo(machine, board):
    """uhid took 200 writes and dropped up to 76 of them in silence."""
    wire = board(faults=FaultConfig(drop_command=1.0))
    with closing(plugged_in(machine, wire)) as backend, pytest.raises(DeviceLost, match=r"101 .* 0\.1 s"):
        [backend.apply(RELAX) for _ in range(200) if following(backend, machine)]


def test_a_host_that_stood_still_is_no_loss(machine, board):
    """One command without an echo, and 0.2 s of the device's time until the host reads again."""
    with closing(plugged_in(machine, board(faults=FaultConfig(drop_command=1.0)))) as backend:
        following(backend, machine)
        backend.apply(RELAX)
        assert all(following(backend, machine) is not None for _ in range(200))


def test_closing_tells_the_gripper_to_let_go(machine, board):
    wire = board()
    backend = plugged_in(machine, wire)
    following(backend, machine)
    backend.apply(Command(EFFORT, 20.0, float("inf"), float("inf")))
    assert wire.firmware.effort_un == 20_000_000
    backend.close()
    assert wire.firmware.effort_un == 0
    assert machine.open_handles == []


def test_same_gripper_is_found_again_by_its_serial_at_another_path(machine, board):
    backend = plugged_in(machine, board(), reconnect_s=60.0)
    following(backend, machine)
    machine.unplug("/dev/hidraw3")
    with pytest.raises(DeviceLost):
        backend.read(60.0)
    backend.close()
    # First another gripper appears in its place, then ours elsewhere.
    machine.plug("/dev/hidraw3", board(serial="R2"), "R2")
    machine.appear.append((machine.listings + 4, "/dev/hidraw9", board(), "L7"))
    assert backend.open(0).serial == "L7"
    assert machine.open_handles[0].path == "/dev/hidraw9"
    assert following(backend, machine).frame.t_s == 0.0
    backend.close()


def test_waiting_for_a_lost_gripper_ends(machine, board):
    backend = plugged_in(machine, board(), reconnect_s=0.01)
    machine.unplug("/dev/hidraw3")
    with pytest.raises(DeviceLost):
        backend.read(60.0)
    with pytest.raises(NoDevice, match=r"1209:0001 .*'L7'"):
        backend.open(0)


def test_first_opening_does_not_wait(machine):
    with pytest.raises(NoDevice):
        Pr2Backend(Pr2Config(reconnect_s=3600.0)).open(0)
    assert machine.listings == 1, "nobody looked again"


def test_serial_of_the_usb_string_must_be_the_boards_own(machine, board):
    machine.plug("/dev/hidraw3", board(serial="R2"), "L7")
    with pytest.raises(NoDevice, match=r"'R2'.*'L7'"):
        Pr2Backend(Pr2Config(serial="L7")).open(0)


def test_a_report_that_waited_in_the_device_is_no_loss_of_all_that_came_after(machine, board):
    """An endpoint keeps a report until somebody asks: it may be hours old when the device is opened."""
    wire = board()
    machine.at_endpoint.append(wire.step()[0])
    for _ in range(500):
        wire.step()
    with closing(plugged_in(machine, wire)) as backend:
        assert all(following(backend, machine) is not None for _ in range(3))
        assert (backend.report()["lost"], backend.report()["reports"]) == (0, 3)
