"""What the driver asks of a wire: whole reports in and out, and the feature report."""

from __future__ import annotations

from abc import ABC, abstractmethod


class TransportGone(Exception):
    """The device is no longer there, or does not take what it is given; the text says which and how it showed."""


class Transport(ABC):
    """An open device. One thread reads, one writes; `close` is called when neither does any more."""

    @abstractmethod
    def read(self, timeout_s: float) -> bytes:
        """Return the next input report with its id, or nothing where none came. Raises TransportGone."""

    @abstractmethod
    def write(self, report: bytes) -> None:
        """Send an output report; that it arrives is not promised. Raises TransportGone."""

    @abstractmethod
    def feature(self, report_id: int) -> bytes:
        """Return a feature report with its id. Raises TransportGone."""

    @abstractmethod
    def close(self) -> None:
        """Let go of the device; may block, does not raise where the device is gone."""
