"""The link between a transport and the driver: it gives the newest report, or reports that the device is gone.

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

from graspsense.gripper_api import DeviceClock, ReadingThread
from graspsense.plugin_api import DeviceLost
from graspsense_pr2_gripper.protocol import MAX_SAMPLES, InputReport
from graspsense_pr2_gripper.stream import RawImage, Restarted, Stream
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone

READ_S: Final = 0.05
"""Longest wait of a read, so that the reader notices a stop."""
OLDEST_S: Final = 0.05
"""Age above which a report is discarded."""
BUFFERED: Final = 64
"""Reports that a buffer of the system holds. More old ones in a row are no rest of a stall of the host."""
JOIN_S: Final = 1.0
"""Time for which closing waits for the reader, and then for the device."""


class Arrival(NamedTuple):
    """A report, the last complete cell image, and the time at which the host read it (monotonic, s).

    `words` are the last samples of the accelerometer that have come without a gap since the arrival before, at most
    `MAX_SAMPLES`; `sampled` is the number of samples that it has taken.
    """

    report: InputReport
    image: RawImage | None
    host_s: float
    words: tuple[int, ...]
    sampled: int


class Link(ABC):
    """An open device as the driver sees it."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.stream = Stream()
        self.clock = DeviceClock()
        self.discarded = 0
        """Number of reports that were too old."""
        self.gone = ""
        """The reason why the device counts as lost; empty while it does not."""
        self.reachable = True
        """Whether commands are still sent: a device that restarted, or whose reports are old, can let go."""

    @property
    def skipped(self) -> int:
        """Number of reports that a newer one replaced before the driver read them."""
        return 0

    def _arrival(self, report: InputReport, host_s: float) -> Arrival:
        return Arrival(
            report=report,
            image=self.stream.image,
            host_s=host_s,
            words=report.samples,
            sampled=self.stream.sampled,
        )

    @abstractmethod
    def next(self, timeout_s: float) -> Arrival | None:
        """Return the newest report not yet returned, or None. Raises DeviceLost."""

    @abstractmethod
    def close(self) -> bool:
        """Close the device in a bounded time; return whether it closed cleanly."""

    def send(self, report: bytes) -> None:
        """Send a command. Raises DeviceLost, at once if the device is known to be out of reach."""
        if not self.reachable:
            # Each write to a device that does not respond may block for seconds.
            raise DeviceLost(self.gone)
        try:
            self.transport.write(report)
        except TransportGone as gone:
            raise self._loss(gone) from gone

    def _loss(self, why: TransportGone | Restarted) -> DeviceLost:
        """Set why the device counts as lost, and return the error that tells it."""
        self.reachable = self.reachable and not isinstance(why, TransportGone)
        self.gone = f"the PR2 gripper is gone ({why}): check its cable and power, then `graspsense devices`"
        return DeviceLost(self.gone)


@final
class LockStepLink(Link):
    """Reads on demand; each read without a waiting report advances the device time by `period_s`."""

    def __init__(self, transport: Transport, period_s: float) -> None:
        super().__init__(transport)
        self._period_s = period_s

    def next(self, timeout_s: float) -> Arrival | None:
        """Advance the device time until a report is valid, at most by `timeout_s`."""
        take, read = self.stream.take, self.transport.read
        try:
            for _ in range(math.ceil(timeout_s / self._period_s - 1e-9)):
                newest = None
                data = read(self._period_s)
                while data:
                    report = take(data)
                    if report is not None:
                        arrival = self._arrival(report, time.monotonic())
                        newest = arrival if newest is None else joined(newest, arrival)
                    data = read(0.0)
                if newest is not None:
                    return newest
        except (TransportGone, Restarted) as gone:
            raise self._loss(gone) from gone
        return None

    def close(self) -> bool:
        """Close the transport."""
        self.transport.close()
        return True


@final
class ThreadedLink(Link):
    """Reads in a thread that starts at construction."""

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport)
        self._closed = False
        self._old = 0
        """Number of consecutive reports that were too old."""
        self._reader = ReadingThread(self._read, name="PR2 reader", joined=joined)

    @property
    def skipped(self) -> int:
        """Number of reports that a newer one replaced before the driver read them."""
        return self._reader.replaced

    def next(self, timeout_s: float) -> Arrival | None:
        """Wait for a report newer than the last one returned."""
        arrival = self._reader.newest(timeout_s)
        if arrival is None and self._old > BUFFERED:
            self.gone = (
                "the times of the PR2 gripper cannot be trusted (its clock falls behind that of this computer, or this "
                f"computer does not keep up: the last {self._old} reports were more than {OLDEST_S:g} s old): power "
                "the board off and on, then `graspsense doctor`"
            )
            raise DeviceLost(self.gone)
        return arrival

    def close(self) -> bool:
        """Stop the reader, then close the device, never during a read; a thread that hangs is abandoned."""
        if self._closed:
            return True
        self._closed = True
        return self._reader.close(JOIN_S) and close_within(self.transport, JOIN_S)

    def _read(self) -> Arrival | None:
        """Return the next report that is new enough, or None. Raises DeviceLost."""
        try:
            data = self.transport.read(READ_S)
            if not data:
                return None
            host_s = time.monotonic()
            report = self.stream.take(data)
            if report is None or not self._in_time(report, host_s):
                return None
            return self._arrival(report, host_s)
        except (TransportGone, Restarted) as gone:
            raise self._loss(gone) from gone

    def _in_time(self, report: InputReport, host_s: float) -> bool:
        """Return whether a report is new enough to be acted on."""
        if self.clock.age_s(report.time_us * 1e-6, host_s) <= OLDEST_S:
            self._old = 0
            return True
        self.discarded += 1
        self._old += 1
        return False


def joined(earlier: Arrival, now: Arrival) -> Arrival:
    """Return the later of two arrivals, with the samples of both where none is missing between them."""
    if earlier.sampled + len(now.words) != now.sampled:
        return now
    return now._replace(words=(*earlier.words, *now.words)[-MAX_SAMPLES:])


def close_within(transport: Transport, time_s: float) -> bool:
    """Close a device in a thread, which is abandoned if it hangs; return whether it closed in time."""
    closer = threading.Thread(target=transport.close, name="PR2 closer", daemon=True)
    closer.start()
    closer.join(time_s)
    return not closer.is_alive()
