"""The reader thread: nothing old is acted on, a loss is told at once, and closing is bounded."""

import threading
import time
from contextlib import closing
from types import SimpleNamespace

import pytest

from graspsense.plugin_api import DeviceLost
from graspsense_pr2_gripper import link as links
from graspsense_pr2_gripper.link import ThreadedLink
from graspsense_pr2_gripper.protocol import InputReport, encode_input
from graspsense_pr2_gripper.transports.interface import TransportGone


def report(sequence, time_us):
    return encode_input(InputReport(sequence, time_us, 0, 0, 0, 0, 0, (), 0, 0, (0, 0, 0, 0), 0, 0))


def drained(link, wire, count):
    """Wait until the reader has taken `count` reports, however long that takes here."""
    while link.stream.counts.reports < count:
        time.sleep(0.001)


@pytest.fixture
def host(monkeypatch):
    """The host's clock, which stands still until a test sets it."""
    now = [100.0]
    monkeypatch.setattr(links, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


def test_reader_counts_what_was_too_old_and_hands_on_the_fresh_one(host, fed):
    """After a stall of 300 ms the buffer holds the 64 reports that came first."""
    wire = fed()
    with closing(ThreadedLink(wire, 0.001)) as link:
        now_us = 10_000_000
        wire.reports.put(report(1, now_us))
        assert link.next(60.0) is not None
        host[0] += 0.3
        for i in range(64):
            wire.reports.put(report(2 + i, now_us + 1000 * (1 + i)))
        drained(link, wire, 65)
        wire.reports.put(report(301, now_us + 300_000))
        arrival = link.next(60.0)
        assert arrival is not None
        assert arrival.report.sequence == 301
        assert link.discarded == 64


@pytest.mark.usefixtures("host")
def test_newest_report_replaces_the_one_nobody_asked_for(fed):
    wire = fed()
    with closing(ThreadedLink(wire, 0.001)) as link:
        for i in range(6):
            wire.reports.put(report(i, 1000 * i))
        drained(link, wire, 6)
        arrival = link.next(60.0)
        while arrival is not None and arrival.report.sequence < 5:
            arrival = link.next(60.0)
        assert arrival is not None
        assert arrival.report.sequence == 5
        assert link.skipped >= 4
        assert link.next(0.0) is None


def test_loss_is_told_with_its_reason(fed):
    wire = fed()
    link = ThreadedLink(wire, 0.001)
    wire.reports.put(TransportGone("read error"))
    with pytest.raises(DeviceLost, match=r"read error.*graspsense devices"):
        link.next(60.0)
    # No further write is tried: one to a device that answers nothing may block for seconds.
    with pytest.raises(DeviceLost, match="read error"):
        link.send(bytes(64))
    assert link.close()
    assert wire.closed.is_set()
    # Closed again, it leaves the device alone.
    wire.closed.clear()
    assert link.close()
    assert not wire.closed.is_set()


@pytest.mark.parametrize("where", ["stuck_in_read", "stuck_in_close"])
def test_closing_is_bounded_where_the_library_hangs(monkeypatch, where, fed):
    """pyusb's close was seen to hang for more than 8 s on a device that answers nothing."""
    monkeypatch.setattr(links, "JOIN_S", 0.3)
    wire = fed()
    setattr(wire, where, True)
    link = ThreadedLink(wire, 0.001)
    if where == "stuck_in_close":
        # The reader has ended already, so that what is waited for in vain is the device alone.
        assert link._reader.close(60.0)
    assert link.close() is False
    assert not wire.closed.is_set(), "never closed under a read"
    wire.freed.set()
    if where == "stuck_in_close":
        assert wire.closed.wait(60.0)
    for thread in threading.enumerate():
        if thread.name.startswith("PR2"):
            thread.join(60.0)
