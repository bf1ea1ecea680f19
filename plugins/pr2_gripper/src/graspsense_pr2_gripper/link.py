"""Between a transport and the driver: the newest report, fresh, or word that the device is gone.

`ThreadedLink` reads in a thread of its own, one report after another without pause, and hands on none that waited too
long in some buffer: behind a Linux hidraw node the oldest 64 are kept and the newer lost. `LockStepLink` reads when
it is asked, for an emulated device whose time passes with the reads.
"""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from typing import Final, NamedTuple, final

from graspsense.plugin_api import DeviceLost
from graspsense_pr2_gripper.clock import DeviceClock
from graspsense_pr2_gripper.protocol import InputReport
from graspsense_pr2_gripper.stream import Image, Restarted, Stream
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone

READ_S: Final = 0.05
"""A read waits at most this long, so that the reader hears of a stop."""
OLDEST_S: Final = 0.05
"""A report older than this is not handed on."""
JOIN_S: Final = 1.0
"""Closing waits this long for the reader, then for the device."""


class Arrival(NamedTuple):
    """A report, the last whole cell image there was with it, and when the host read it (monotonic seconds)."""

    report: InputReport
    image: Image | None
    host_s: float


class Link(ABC):
    """An open device from the driver's side."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.stream = Stream()
        self.clock = DeviceClock()
        self.discarded = 0
        """Reports that were too old to be acted on."""
        self.skipped = 0
        """Reports that a newer one replaced before the driver asked."""
        self.gone = ""
        """Why the device is gone; empty while it is there."""

    @abstractmethod
    def next(self, timeout_s: float) -> Arrival | None:
        """Return the newest report not yet returned, or None. Raises DeviceLost."""

    @abstractmethod
    def close(self) -> bool:
        """Let go of the device, bounded in time; return whether it was let go of cleanly."""

    def send(self, report: bytes) -> None:
        """Send a command. Raises DeviceLost, at once where the device is known to be gone."""
        if self.gone:
            # A write to a device that answers nothing may block for seconds, each time.
            raise DeviceLost(self.gone)
        try:
            self.transport.write(report)
        except TransportGone as gone:
            self.gone = _lost(gone)
            raise DeviceLost(self.gone) from gone


@final
class LockStepLink(Link):
    """Reads when asked; `period_s` of device time pass with each read that finds nothing waiting."""

    def __init__(self, transport: Transport, period_s: float) -> None:
        super().__init__(transport)
        self._period_s = period_s

    def next(self, timeout_s: float) -> Arrival | None:
        """Let device time pass until a report is good, at most `timeout_s`."""
        take, read = self.stream.take, self.transport.read
        try:
            for _ in range(math.ceil(timeout_s / self._period_s - 1e-9)):
                newest = None
                data = read(self._period_s)
                while data:
                    newest = take(data) or newest
                    data = read(0.0)
                if newest is not None:
                    return Arrival(newest, self.stream.image, time.monotonic())
        except (TransportGone, Restarted) as gone:
            self.gone = _lost(gone)
            raise DeviceLost(self.gone) from gone
        return None

    def close(self) -> bool:
        """Close the transport."""
        self.transport.close()
        return True


@final
class ThreadedLink(Link):
    """Reads in a daemon thread from the moment it is made."""

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._arrived = threading.Condition()
        self._newest: Arrival | None = None
        self._stop = threading.Event()
        self._closed = False
        self._reader = threading.Thread(target=self._run, name="PR2 reader", daemon=True)
        self._reader.start()

    def next(self, timeout_s: float) -> Arrival | None:
        """Wait for a report newer than the last one returned."""
        give_up = time.monotonic() + timeout_s
        with self._arrived:
            while self._newest is None:
                if self.gone:
                    raise DeviceLost(self.gone)
                left = give_up - time.monotonic()
                if left <= 0.0:
                    return None
                self._arrived.wait(left)
            newest, self._newest = self._newest, None
            return newest

    def close(self) -> bool:
        """Stop the reader, then close the device: never under a read, and in a thread that may be left behind."""
        if self._closed:
            return True
        self._closed = True
        self._stop.set()
        self._reader.join(JOIN_S)
        if self._reader.is_alive():
            return False
        return close_within(self.transport, JOIN_S)

    def _run(self) -> None:
        stream, clock = self.stream, self.clock
        try:
            while not self._stop.is_set():
                data = self.transport.read(READ_S)
                if not data:
                    continue
                host_s = time.monotonic()
                report = stream.take(data)
                if report is None:
                    continue
                if clock.age_s(report.time_us * 1e-6, host_s) > OLDEST_S:
                    self.discarded += 1
                    continue
                arrival = Arrival(report, stream.image, host_s)
                with self._arrived:
                    if self._newest is not None:
                        self.skipped += 1
                    self._newest = arrival
                    self._arrived.notify()
        except (TransportGone, Restarted) as gone:
            with self._arrived:
                self.gone = _lost(gone)
                self._arrived.notify()


def close_within(transport: Transport, time_s: float) -> bool:
    """Close a device in a thread that is left behind where it hangs; return whether it closed in time."""
    closer = threading.Thread(target=transport.close, name="PR2 closer", daemon=True)
    closer.start()
    closer.join(time_s)
    return not closer.is_alive()


def _lost(why: Exception) -> str:
    return f"the PR2 gripper is gone ({why}): check its cable and power, then `graspsense devices`"
