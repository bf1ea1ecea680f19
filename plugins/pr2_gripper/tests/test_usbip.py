"""The board as a USB device, spoken to over a socket as vhci-hcd does."""

from __future__ import annotations

import errno
import gc
import json
import os
import socket
import struct
import sys
import threading

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense.cli.main import main
from graspsense.plugin_api import create
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.emulator import board as boards
from graspsense_pr2_gripper.emulator.board import EmulatedBoard
from graspsense_pr2_gripper.emulator.port import Plug, Port
from graspsense_pr2_gripper.emulator.usbip import (
    HEADER,
    RET_SUBMIT,
    RET_UNLINK,
    RETURN,
    SUBMIT,
    SUBMITTED,
    UNLINK,
    UsbipServer,
)
from graspsense_pr2_gripper.protocol import (
    EFFORT_KIND,
    OWN_LIMIT,
    REPORT_DESCRIPTOR,
    OutputReport,
    decode_identity,
    decode_input,
    encode_output,
)

PLUG = Plug(0x1209, 0x0001, "L7", "a gripper")
CLEAR_HALT = struct.pack("<BBHHH", 0x02, 1, 0, 0x81, 0)


class Taken:
    """A device that keeps what it is sent."""

    def __init__(self):
        self.stalled = False
        self.outputs: list[bytes] = []

    def output(self, report):
        self.outputs.append(report)

    def feature(self, report_id):
        return bytes([report_id]) * 64 if report_id == 3 else None


class Host:
    """The other end of the socket: what the kernel's vhci_tx and vhci_rx do."""

    def __init__(self, connection):
        self.connection = connection
        connection.settimeout(60.0)
        self.number = 0

    def submit(self, endpoint, into, length, setup=bytes(8), data=b""):
        self.number += 1
        asked = SUBMITTED.pack(0, length, 0, 0, 0, setup)
        self.connection.sendall(
            HEADER.pack(SUBMIT, self.number, 1 << 16 | 2, int(into), endpoint, asked) + data
        )

        return self.number

    def unlink(self, victim):
        self.number += 1
        asked = struct.pack(">I24x", victim)
        self.connection.sendall(HEADER.pack(UNLINK, self.number, 1 << 16 | 2, 0, 0, asked))
        return self.number

    def answer(self, reads=True):
        """Return what came: kind, number, status, data."""
        head = self.exactly(48)
        kind, number, _, _, _, status, length, *_ = RETURN.unpack(head)
        data = self.exactly(length) if kind == RET_SUBMIT and reads and status == 0 else b""
        return kind, number, status, data

    def exactly(self, size):
        data = b""
        while len(data) < size:
            more = self.connection.recv(size - len(data))
            assert more, "the device hung up"
            data += more
        return data

    def control(self, kind, request, value, index, length):
        setup = struct.pack("<BBHHH", kind, request, value, index, length)
        self.submit(0, bool(kind & 0x80), length, setup)
        _, _, status, data = self.answer(reads=bool(kind & 0x80))
        return status, data


class Served:
    """A server with its thread, and the host at the other end."""

    def __init__(self, server):
        ours, theirs = socket.socketpair()
        self.server = server
        self.server.connect(ours)
        self.thread = threading.Thread(target=self.server.serve)
        self.thread.start()
        self.ours, self.host = ours, Host(theirs)

    def close(self):
        self.server.hang_up()
        self.thread.join(60.0)
        assert not self.thread.is_alive()
        self.ours.close()
        self.host.connection.close()


@pytest.fixture
def device():
    return Taken()


@pytest.fixture
def served(device):
    server = Served(UsbipServer(device, PLUG))
    yield server
    server.close()


def test_a_host_finds_the_device_that_the_document_describes(served):
    host = served.host
    status, about = host.control(0x80, 6, 1 << 8, 0, 18)
    assert status == 0
    assert struct.unpack_from("<HH", about, 8) == (0x1209, 0x0001)
    _, short = host.control(0x80, 6, 2 << 8, 0, 9)
    total = struct.unpack_from("<H", short, 2)[0]
    _, configuration = host.control(0x80, 6, 2 << 8, 0, 512)
    assert len(configuration) == total
    endpoints = [configuration[i : i + 7] for i in (total - 14, total - 7)]
    assert [
        (endpoint[2], endpoint[3], struct.unpack_from("<H", endpoint, 4)[0], endpoint[6])
        for endpoint in endpoints
    ] == [
        (0x81, 3, 64, 1),
        (0x01, 3, 64, 1),
    ]
    assert host.control(0x81, 6, 0x22 << 8, 0, 512) == (0, REPORT_DESCRIPTOR)
    _, serial = host.control(0x80, 6, 3 << 8 | 3, 0x409, 255)
    assert serial[2:].decode("utf-16-le") == "L7"
    assert host.control(0xA1, 1, 3 << 8 | 3, 0, 64) == (0, b"\3" * 64)
    assert host.control(0xA1, 1, 3 << 8 | 9, 0, 64) == (-errno.EPIPE, b""), "a report that there is none of"


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.sampled_from(["in", "out", "control", "report", "stall", "well", "halt"]), st.integers(1, 12)
        )
    )
)
def test_every_unlink_is_answered_and_every_transfer_ends_once(does):
    """Whatever the device's mood. A host whose unlink is not answered hangs for good."""
    device = Taken()
    served = Served(UsbipServer(device, PLUG))
    host = served.host
    try:
        submitted = set()
        unlinks = {}
        ended = []
        reading = {}

        def hear():
            head = host.exactly(48)
            kind, number, _, _, _, status, length, *_ = RETURN.unpack(head)
            if kind == RET_SUBMIT:
                if reading[number] and status == 0:
                    host.exactly(length)
                ended.append(number)
            else:
                assert kind == RET_UNLINK
                victim = unlinks.pop(number)
                assert status in (0, -errno.ECONNRESET)
                if status:
                    ended.append(victim)

        for doe in does:
            if doe == "in":
                reading[host.submit(1, True, 64)] = True
                submitted.add(host.number)
            elif doe == "out":
                reading[host.submit(1, False, 64, data=bytes(64))] = False
                submitted.add(host.number)
            elif doe == "control":
                reading[host.submit(0, True, 18, struct.pack("<BBHHH", 0x80, 6, 1 << 8, 0, 18))] = True
                submitted.add(host.number)
            elif doe == "report":
                served.server.send(bytes(64))
            elif doe == "halt":
                served.server.halt()
            elif isinstance(doe, int):
                unlinks[host.unlink(doe)] = doe
                while unlinks:
                    hear()
            else:
                device.stalled = doe == "stall"
        device.stalled = False
        for victim in sorted(submitted - set(ended)):
            if victim not in ended:
                unlinks[host.unlink(victim)] = victim
                while unlinks:
                    hear()
        assert sorted(ended) == sorted(submitted)
    finally:
        served.close()


def test_a_halted_endpoint_stalls_until_it_is_cleared(served):
    host, server = served.host, served.server
    server.send(b"\1" * 64)
    host.submit(1, True, 64)
    assert host.answer()[3] == b"\1" * 64
    server.halt()
    host.submit(1, True, 64)
    assert host.answer()[2] == -errno.EPIPE
    host.submit(0, False, 0, CLEAR_HALT)
    assert host.answer(reads=False)[2] == 0
    host.submit(1, True, 64)
    server.send(b"\2" * 64)
    assert host.answer()[3] == b"\2" * 64


def test_the_endpoint_holds_one_report_and_what_comes_meanwhile_is_lost(served):
    host, server = served.host, served.server
    assert [server.send(bytes([n]) * 64) for n in range(3)] == [False, True, True]
    host.submit(1, True, 64)
    assert host.answer()[3] == b"\0" * 64
    host.submit(1, True, 64)
    assert server.send(b"\3" * 64) is False
    assert host.answer()[3] == b"\3" * 64


class SocketPort(Port):
    """A socket where vhci-hcd would be."""

    def __init__(self, board, plug):
        self.server = UsbipServer(board, plug)
        self.served: Served | None = None

    @property
    def host(self):
        assert self.served is not None, "it is plugged in"
        return self.served.host

    def plug(self):
        self.served = Served(self.server)

    def unplug(self):
        if self.served is not None:
            self.served.close()
            self.served = None

    def send(self, report):
        return self.server.send(report)

    def close(self):
        self.unplug()


@pytest.fixture
def ports(monkeypatch):
    """The ports that boards were plugged into; a node is the kernel's matter, so there is one."""
    made = []

    def make(board, plug):
        made.append(SocketPort(board, plug))
        return made[-1]

    monkeypatch.setitem(boards._PORTS, "usb", make)
    monkeypatch.setitem(boards._WHY_NOT, "usb", lambda: "")
    monkeypatch.setattr(EmulatedBoard, "node", lambda self: "/dev/hidraw0")
    return made


class HandClock:
    """In place of `on_time`: a period passes when the test says so, and freely once it is over."""

    def __init__(self):
        self._due, self._past = threading.Semaphore(0), threading.Semaphore(0)
        self._free = False

    def __call__(self, period_s):
        while self._free or self._due.acquire():
            yield 0.0
            self._past.release()

    def let_pass(self, periods):
        """Return when they are over."""
        self.begin(periods)
        for _ in range(periods):
            assert self._past.acquire(timeout=60.0)

    def begin(self, periods=1):
        self._due.release(periods)

    def free(self):
        self._free = True
        self.begin()


@pytest.fixture
def clock(monkeypatch):
    """The time of an emulated board."""
    made = HandClock()
    monkeypatch.setattr(boards, "on_time", made)
    return made


@pytest.fixture
def emulated(ports, clock):
    """The whole emulator over a socket, its jaws at a block."""
    config = Pr2Config(transport="emulated", serial="L7", object="block")
    board = EmulatedBoard(config, "usb", 0)
    board.tell("plug")
    yield board, ports[0]
    clock.free()
    board.close()


SQUEEZE = encode_output(OutputReport(1, EFFORT_KIND, 20_000_000, OWN_LIMIT, OWN_LIMIT))
WATCHDOG_PERIODS = 100


def test_the_command_does_what_it_is_told_until_it_is_told_to_quit(ports, monkeypatch, capsys):
    read, write = os.pipe()
    os.write(write, b"unplug\nstate\nunplugg\nplug\nhelp\nquit\n")  # at once, as a script writes them
    os.close(write)
    told, kept = EmulatedBoard.tell, []

    def tell(board, word):
        kept.append(gc.get_freeze_count())
        told(board, word)

    monkeypatch.setattr(EmulatedBoard, "tell", tell)
    with os.fdopen(read) as standard_input:
        monkeypatch.setattr(sys, "stdin", standard_input)
        with pytest.raises(SystemExit) as ended:
            main(["emulate", "pr2", "--json", "--wire", "usb", "--object", "block"])
    assert all(kept), "a full collection would hold back reports for tens of milliseconds"
    assert gc.get_freeze_count() == 0
    said = capsys.readouterr()
    states = [json.loads(line) for line in said.out.splitlines()]
    assert ended.value.code == 0
    assert [(state["did"], state["plugged"]) for state in states] == [
        ("plug", True),
        ("unplug", False),
        ("state", False),
        ("plug", True),
    ]
    assert "no word 'unplugg'" in said.err
    assert "Did you mean 'unplug'?" in said.err
    assert "complete nothing, in either direction" in said.err
    assert ports[0].served is None, "it is gone with the command"


def test_a_pulled_plug_leaves_nothing_squeezing(emulated, clock):
    board, port = emulated
    host = port.host
    status, feature = host.control(0xA1, 1, 3 << 8 | 3, 0, 64)
    assert status == 0
    assert decode_identity(feature).serial == "L7"
    host.submit(1, False, 64, data=SQUEEZE)
    assert host.answer(reads=False)[2] == 0
    board.tell("unplug")
    clock.let_pass(WATCHDOG_PERIODS // 2)
    assert board.state()["effort_n"] == 20.0, "it still hopes for a command"
    clock.let_pass(WATCHDOG_PERIODS)
    assert board.state()["effort_n"] == 0.0
    board.tell("plug")
    port.host.submit(1, True, 64)
    clock.let_pass(1)
    report = decode_input(port.host.answer()[3])
    assert report.echo == 1, "the board kept its power"
    assert report.status & 1, "and says that it has let go"


@pytest.mark.parametrize("word", ["silent", "stalled"])
def test_a_mood_stops_the_reports_and_the_watchdog_lets_go(emulated, clock, word):
    board, port = emulated
    port.host.submit(1, False, 64, data=SQUEEZE)
    port.host.answer(reads=False)
    clock.let_pass(3)
    board.tell(word)
    assert (board.state()["sent"], board.state()["effort_n"]) == (3, 20.0)
    clock.let_pass(WATCHDOG_PERIODS)
    assert (board.state()["sent"], board.state()["effort_n"]) == (3, 0.0)
    read = port.host.submit(1, True, 64)
    unlink = port.host.unlink(read)
    answer = port.host.answer()[:2]
    if answer == (RET_SUBMIT, read):  # the report that was armed before
        answer = port.host.answer()[:2]
    assert answer == (RET_UNLINK, unlink)


def test_a_body_that_fails_is_a_device_that_goes_away(emulated, clock, monkeypatch):
    board, _ = emulated
    body = create("sensor-backend", "sim")
    monkeypatch.setattr(type(body), "read", lambda self, timeout_s: 1 / 0)
    clock.begin()
    board._thread.join(60.0)
    state = board.state()
    assert (state["plugged"], state["failed"]) == (False, "ZeroDivisionError: division by zero")
