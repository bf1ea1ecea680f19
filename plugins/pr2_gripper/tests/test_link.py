"""The reader thread: nothing old is acted on, a loss is told at once, and closing is bounded."""

import threading
import time
from contextlib import closing, nullcontext
from types import SimpleNamespace

import pytest
from cases import every_case

from graspsense.plugin_api import DeviceLost
from graspsense_pr2_gripper import link as links
from graspsense_pr2_gripper.link import ThreadedLink
from graspsense_pr2_gripper.protocol import InputReport, encode_input
from graspsense_pr2_gripper.transports.interface import TransportGone


def report(sequence, time_us):
    return encode_input(InputReport(sequence, time_us, 0, 0, 0, 0, 0, (), 0, 0, (0, 0, 0, 0), 0, 0))


def drained(link, count):
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
    wire = fed(report(1, 10_000_000))
    with closing(ThreadedLink(wire)) as link:
        assert link.next(60.0) is not None
        host[0] += 0.3
        for i in range(1, 65):
            wire.reports.put(report(1 + i, 10_000_000 + 1000 * i))
        drained(link, 65)
        wire.reports.put(report(301, 10_300_000))
        assert link.next(60.0).report.sequence == 301
        assert link.discarded == 64


@every_case(
    ("old", "expected"), [(64, nullcontext()), (65, pytest.raises(DeviceLost, match=r"behind.*last 65"))]
)
def test_clock_that_falls_behind_the_hosts_is_told(host, fed, old, expected):
    """64 old reports can come from a buffer; the 65th cannot. The board is slow in all it does, reports too."""
    wire = fed(report(0, 0))
    with closing(ThreadedLink(wire)) as link:
        assert link.next(60.0) is not None
        host[0] += 0.2
        for i in range(1, old + 1):
            wire.reports.put(report(i, 1000 * i))
        while link.discarded < old:
            time.sleep(0.001)
        with expected:
            assert link.next(0.0) is None


@pytest.mark.usefixtures("host")
def test_newest_report_replaces_the_one_nobody_asked_for(fed):
    with closing(ThreadedLink(fed(*(report(i, 1000 * i) for i in range(6))))) as link:
        drained(link, 6)
        while link.next(60.0).report.sequence < 5:
            pass
        assert link.skipped >= 4
        assert link.next(0.0) is None


def test_loss_is_told_with_its_reason(fed):
    wire = fed()
    link = ThreadedLink(wire)
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
    link = ThreadedLink(wire)
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
