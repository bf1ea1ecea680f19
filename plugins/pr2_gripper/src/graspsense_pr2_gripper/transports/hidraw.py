"""HID through hidapi: on Linux its module `hidraw`, which leaves the device to the kernel and sees uhid devices."""

from __future__ import annotations

import math
from importlib import import_module
from typing import Any, final

from graspsense_pr2_gripper.discovery import LIBRARY, HidDevice
from graspsense_pr2_gripper.protocol import REPORT_SIZE
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone


@final
class HidrawTransport(Transport):
    """A device opened by its path. Raises OSError where it cannot be opened."""

    def __init__(self, device: HidDevice) -> None:
        self._path = device.path
        self._device: Any = import_module(LIBRARY).device()
        self._device.open_path(device.path.encode())

    def read(self, timeout_s: float) -> bytes:
        """Return the next report, as hidapi's list of integers made bytes."""
        # A timeout of 0 would call the read that blocks for good.
        timeout_ms = max(1, math.ceil(timeout_s * 1e3))
        try:
            return bytes(self._device.read(REPORT_SIZE, timeout_ms=timeout_ms))
        except (OSError, ValueError) as error:
            raise TransportGone(f"reading {self._path}: {error}") from error

    def write(self, report: bytes) -> None:
        """Send a report; hidapi tells of a device that is gone by -1 alone."""
        try:
            written = self._device.write(report)
        except (OSError, ValueError) as error:
            raise TransportGone(f"writing to {self._path}: {error}") from error
        if written != len(report):
            raise TransportGone(f"writing to {self._path}: {written} of {len(report)} bytes were taken")

    def feature(self, report_id: int) -> bytes:
        """Return a feature report."""
        try:
            return bytes(self._device.get_feature_report(report_id, REPORT_SIZE))
        except (OSError, ValueError) as error:
            raise TransportGone(f"feature report {report_id} of {self._path}: {error}") from error

    def close(self) -> None:
        """Close the node."""
        self._device.close()
