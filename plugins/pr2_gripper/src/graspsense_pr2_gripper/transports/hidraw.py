"""HID through hidapi: on Linux its module `hidraw`, which keeps the kernel driver and supports uhid devices."""

from __future__ import annotations

import math
import threading
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any, Final, final

from graspsense_pr2_gripper.discovery import LIBRARY, HidDevice
from graspsense_pr2_gripper.protocol import REPORT_SIZE
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone

WRITE_TIMEOUT_S: Final = 0.25
"""Largest time of a write. If an endpoint is stalled, the kernel itself waits for 5 s, without interruption."""


@final
class HidrawTransport(Transport):
    """A device opened by its path. Raises OSError if it cannot be opened.

    A separate thread writes, so that a stalled endpoint is reported within `WRITE_TIMEOUT_S`.
    """

    def __init__(self, device: HidDevice) -> None:
        self._path = device.path
        self._device: Any = import_module(LIBRARY).device()
        self._device.open_path(device.path.encode())
        self._reports: SimpleQueue[bytes | None] = SimpleQueue()
        self._written: SimpleQueue[int | Exception] = SimpleQueue()
        self._writer = threading.Thread(target=self._write_all, name="PR2 writer", daemon=True)
        self._writer.start()

    def read(self, timeout_s: float) -> bytes:
        """Return the next report; hidapi gives it as a list of integers."""
        # A timeout of 0 would mean to wait forever.
        timeout_ms = max(1, math.ceil(timeout_s * 1e3))
        try:
            return bytes(self._device.read(REPORT_SIZE, timeout_ms=timeout_ms))
        except (OSError, ValueError) as error:
            raise TransportGone(f"reading {self._path}: {error}") from error

    def write(self, report: bytes) -> None:
        """Send a report; for a lost device, hidapi returns -1 without a reason."""
        self._reports.put(report)
        try:
            written = self._written.get(timeout=WRITE_TIMEOUT_S)
        except Empty:
            raise TransportGone(
                f"writing to {self._path}: not accepted within {WRITE_TIMEOUT_S:g} s"
            ) from None
        if isinstance(written, Exception):
            raise TransportGone(f"writing to {self._path}: {written}") from written
        if written != len(report):
            raise TransportGone(f"writing to {self._path}: {written} of {len(report)} bytes were accepted")

    def feature(self, report_id: int) -> bytes:
        """Return a feature report."""
        try:
            return bytes(self._device.get_feature_report(report_id, REPORT_SIZE))
        except (OSError, TypeError, ValueError) as error:
            raise TransportGone(f"feature report {report_id} of {self._path}: {error}") from error

    def close(self) -> None:
        """Close the node, after a stalled write has ended."""
        self._reports.put(None)
        self._writer.join()
        self._device.close()

    def _write_all(self) -> None:
        while (report := self._reports.get()) is not None:
            try:
                self._written.put(self._device.write(report))
            except (OSError, ValueError) as error:
                self._written.put(error)
