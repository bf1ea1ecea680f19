"""The interface of a transport: complete reports in both directions, and the feature report."""

from __future__ import annotations

from abc import ABC, abstractmethod


class TransportGone(Exception):
    """The device is gone, or does not accept data; the text states which, and how this was detected."""


class Transport(ABC):
    """An open device. One thread reads, one writes; `close` is called when both have ended."""

    @abstractmethod
    def read(self, timeout_s: float) -> bytes:
        """Return the next input report with its id, or empty bytes if none came. Raises TransportGone."""

    @abstractmethod
    def write(self, report: bytes) -> None:
        """Send an output report, without a guarantee that it arrives. Raises TransportGone."""

    @abstractmethod
    def feature(self, report_id: int) -> bytes:
        """Return a feature report with its id. Raises TransportGone."""

    @abstractmethod
    def close(self) -> None:
        """Close the device; may block, and does not raise if the device is gone."""
