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
from contextlib import closing

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
    LET_GO,
    OWN_LIMIT,
    REPORT_DESCRIPTOR,
    OutputReport,
    decode_identity,
    decode_input,
    encode_output,
)

PLUG = Plug(0x1209, 0x0001, "L7", "a gripper")
CLEAR_HALT = (0x02, 1, 0, 0x81, 0)


class Taken:
    """A device that takes whatever it is sent."""

    stalled = False

    def output(self, report):
        pass

    def feature(self, report_id):
        return bytes([report_id]) * 64 if report_id == 3 else None


class Host:
    """The other end of the socket of a server: what the kernel's vhci_tx and vhci_rx do."""

    def __init__(self, server):
        self.server, self.number = server, 0
        self.reads: dict[int, bool] = {}
        """For each transfer that was submitted, whether the answer has data."""
        self.theirs, self.connection = socket.socketpair()
        self.connection.settimeout(60.0)
        server.connect(self.theirs)
        self.thread = threading.Thread(target=server.serve)
        self.thread.start()

    def close(self):
        self.server.hang_up()
        self.thread.join(60.0)
        assert not self.thread.is_alive()
        self.theirs.close()
        self.connection.close()

    def submit(self, endpoint, into, length, setup=bytes(8), data=b""):
        asked = SUBMITTED.pack(0, length, 0, 0, 0, setup)
        number = self._request(SUBMIT, int(into), endpoint, asked + data)
        self.reads[number] = into
        return number

    def unlink(self, victim):
        return self._request(UNLINK, 0, 0, struct.pack(">I24x", victim))

    def _request(self, kind, into, endpoint, asked):
        self.number += 1
        self.connection.sendall(
            HEADER.pack(kind, self.number, 1 << 16 | 2, into, endpoint, asked[:28]) + asked[28:]
        )
        return self.number

    def answer(self):
        """Return what came: kind, number, status, data."""
        kind, number, _, _, _, status, length, *_ = RETURN.unpack(self._exactly(48))
        has_data = kind == RET_SUBMIT and self.reads[number] and status == 0
        return kind, number, status, self._exactly(length) if has_data else b""

    def _exactly(self, size):
        data = self.connection.recv(size, socket.MSG_WAITALL)
        assert len(data) == size, "the device hung up"
        return data

    def control(self, kind, request, value, index, length):
        self.submit(0, bool(kind & 0x80), length, struct.pack("<BBHHH", kind, request, value, index, length))
        return self.answer()[2:]

    def squeeze(self):
        """Command an effort of 20 N."""
        self.submit(
            1, False, 64, data=encode_output(OutputReport(1, EFFORT_KIND, 20_000_000, OWN_LIMIT, OWN_LIMIT))
        )
        assert self.answer()[2] == 0


@pytest.fixture
def host():
    with closing(Host(UsbipServer(Taken(), PLUG))) as host:
        yield host


def test_a_host_finds_the_device_that_the_document_describes(host):
    status, about = host.control(0x80, 6, 1 << 8, 0, 18)
    assert (status, struct.unpack_from("<HH", about, 8)) == (0, (0x1209, 0x0001))
    _, short = host.control(0x80, 6, 2 << 8, 0, 9)
    _, configuration = host.control(0x80, 6, 2 << 8, 0, 512)
    assert len(configuration) == struct.unpack_from("<H", short, 2)[0]
    # Address, attributes, largest packet and interval of both interrupt endpoints.
    endpoints = [struct.unpack("<BBHB", row[2:]) for row in (configuration[-14:-7], configuration[-7:])]
    assert endpoints == [(0x81, 3, 64, 1), (0x01, 3, 64, 1)]
    assert host.control(0x81, 6, 0x22 << 8, 0, 512) == (0, REPORT_DESCRIPTOR)
    assert host.control(0x80, 6, 3 << 8 | 3, 0x409, 255)[1][2:].decode("utf-16-le") == "L7"
    assert host.control(0xA1, 1, 3 << 8 | 3, 0, 64) == (0, b"\3" * 64)
    assert host.control(0xA1, 1, 3 << 8 | 9, 0, 64) == (-errno.EPIPE, b""), "a report that there is none of"


ASKED = {
    "in": (1, True, 64),
    "out": (1, False, 64, bytes(8), bytes(64)),
    "control": (0, True, 18, struct.pack("<BBHHH", 0x80, 6, 1 << 8, 0, 18)),
}


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from([*ASKED, "report", "stall", "well", "halt"]) | st.integers(1, 12)))
def test_every_unlink_is_answered_and_every_transfer_ends_once(does):
    """Whatever the device's mood. A host whose unlink is not answered hangs for good."""
    device = Taken()
    server = UsbipServer(device, PLUG)
    ended = []
    with closing(Host(server)) as host:

        def unlink(victim):
            asked = host.unlink(victim)
            while (answer := host.answer())[0] == RET_SUBMIT:
                ended.append(answer[1])
            assert answer[:2] == (RET_UNLINK, asked)
            assert answer[2] in (0, -errno.ECONNRESET)
            if answer[2]:
                ended.append(victim)

        for doe in does:
            if doe in ASKED:
                host.submit(*ASKED[doe])
            elif doe == "report":
                server.send(bytes(64))
            elif doe == "halt":
                server.halt()
            elif isinstance(doe, int):
                unlink(doe)
            else:
                device.stalled = doe == "stall"
        device.stalled = False
        for victim in host.reads:
            if victim not in ended:
                unlink(victim)
        assert sorted(ended) == sorted(host.reads)


def test_a_halted_endpoint_stalls_until_it_is_cleared(host):
    host.server.send(b"\1" * 64)
    host.submit(1, True, 64)
    assert host.answer()[3] == b"\1" * 64
    host.server.halt()
    host.submit(1, True, 64)
    assert host.answer()[2] == -errno.EPIPE
    assert host.control(*CLEAR_HALT) == (0, b"")
    host.submit(1, True, 64)
    host.server.send(b"\2" * 64)
    assert host.answer()[3] == b"\2" * 64


def test_the_endpoint_holds_one_report_and_what_comes_meanwhile_is_lost(host):
    assert [host.server.send(bytes([n]) * 64) for n in range(3)] == [False, True, True]
    host.submit(1, True, 64)
    assert host.answer()[3] == b"\0" * 64
    host.submit(1, True, 64)
    assert host.server.send(b"\3" * 64) is False
    assert host.answer()[3] == b"\3" * 64


class SocketPort(Port):
    """A socket where vhci-hcd would be."""

    def __init__(self, board, plug):
        self.server = UsbipServer(board, plug)
        self.host: Host | None = None

    def plug(self):
        self.host = Host(self.server)

    def unplug(self):
        if self.host is not None:
            self.host.close()
            self.host = None

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
    plugged = [("plug", True), ("unplug", False), ("state", False), ("plug", True)]
    assert [(state["did"], state["plugged"]) for state in states] == plugged
    assert "no word 'unplugg'" in said.err
    assert "'unplug'?" in said.err
    assert "complete nothing, in either direction" in said.err
    assert ports[0].host is None, "it is gone with the command"


def test_a_pulled_plug_leaves_nothing_squeezing(emulated, clock):
    board, port = emulated
    assert decode_identity(port.host.control(0xA1, 1, 3 << 8 | 3, 0, 64)[1]).serial == "L7"
    port.host.squeeze()
    board.tell("unplug")
    clock.let_pass(WATCHDOG_PERIODS // 2)
    assert board.state()["effort_n"] == 20.0, "it still hopes for a command"
    clock.let_pass(WATCHDOG_PERIODS)
    assert board.state()["effort_n"] == 0.0
    board.tell("plug")
    port.host.submit(1, True, 64)
    clock.let_pass(1)
    report = decode_input(port.host.answer()[3])
    assert (report.echo, report.status & LET_GO) == (1, LET_GO), (
        "it kept its power, and says that it has let go"
    )


@pytest.mark.parametrize("word", ["silent", "stalled"])
def test_a_mood_stops_the_reports_and_the_watchdog_lets_go(emulated, clock, word):
    board, port = emulated
    port.host.squeeze()
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
