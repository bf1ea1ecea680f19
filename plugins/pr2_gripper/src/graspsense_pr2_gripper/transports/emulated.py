"""An emulated board in this process, in lock-step with its reader or in real time."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterator
from typing import Final, final

from graspsense_pr2_gripper.faults import Wire
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone

_GONE: Final = "the emulated cable was pulled"
QUEUE: Final = 64
"""Largest number of queued reports; newer ones are lost, as with a Linux hidraw node."""


class LockStepTransport(Transport):
    """Device time advances by one period whenever a read finds no queued report, and at no other time."""

    def __init__(self, wire: Wire) -> None:
        self._wire, self._failed = wire, ""
        self._period_s = 1.0 / wire.firmware.identity.report_rate_hz
        self._waiting: deque[bytes] = deque()

    def read(self, timeout_s: float) -> bytes:
        """Return a queued report, or advance the device by up to `timeout_s` until there is one."""
        waiting = self._waiting
        if not waiting:
            for _ in range(math.ceil(timeout_s / self._period_s - 1e-9)):
                waiting.extend(self._wire.step())
                self._check()
                if waiting:
                    break
        return waiting.popleft() if waiting else b""

    def write(self, report: bytes) -> None:
        """Send a command to the board."""
        self._check()
        self._wire.output(report)

    def feature(self, report_id: int) -> bytes:
        """Return the feature report of the board."""
        return self._wire.feature()

    def close(self) -> None:
        """Do nothing: there are no resources."""

    def _check(self) -> None:
        if self._wire.unplugged or self._failed:
            raise TransportGone(self._failed or _GONE)


@final
class PacedTransport(LockStepTransport):
    """The board runs in its own thread, on a grid of absolute times."""

    def __init__(self, wire: Wire) -> None:
        super().__init__(wire)
        self._arrived = threading.Condition()
        self._stop = False
        self._thread = threading.Thread(target=self._run, name="emulated PR2 board", daemon=True)
        self._thread.start()

    def read(self, timeout_s: float) -> bytes:
        """Wait for a report."""
        with self._arrived:
            self._arrived.wait_for(lambda: self._waiting or self._wire.unplugged or self._failed, timeout_s)
            if self._waiting:
                return self._waiting.popleft()
            self._check()
            return b""

    def write(self, report: bytes) -> None:
        """Send a command to the board."""
        with self._arrived:
            super().write(report)

    def close(self) -> None:
        """Stop the thread of the board."""
        self._stop = True
        self._thread.join()

    def _run(self) -> None:
        try:
            for _ in on_time(self._period_s):
                if self._stop:
                    return
                with self._arrived:
                    for report in self._wire.step():
                        if len(self._waiting) < QUEUE:
                            self._waiting.append(report)
                    self._arrived.notify()
        except Exception as error:
            # The simulated fingers can be a user's code and fail; the host then sees a lost device.
            with self._arrived:
                self._failed = f"the emulated board failed: {type(error).__name__}: {error}"
                self._arrived.notify()


def on_time(period_s: float) -> Iterator[float]:
    """Yield once a period on a grid of absolute times, with how late it is in seconds.

    What is late is made up for, so that the device's clock stays with the host's.
    """
    due = time.monotonic()
    while True:
        yield max(time.monotonic() - due, 0.0)
        due += period_s
        wait_s = due - time.monotonic()
        if wait_s > 0.0:
            time.sleep(wait_s)
