"""What an emulated board asks of a way into this machine's HID stack, and the other way round."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple, Protocol


class Plug(NamedTuple):
    """Who the device says it is when it is plugged in."""

    vendor_id: int
    product_id: int
    serial: str
    product: str


class Device(Protocol):
    """The board, as its port calls it; any thread may."""

    @property
    def stalled(self) -> bool:
        """Whether nothing completes, in either direction."""

    def output(self, report: bytes) -> None:
        """Take an output report of the host's."""

    def feature(self, report_id: int) -> bytes | None:
        """Return a feature report, or None where there is none."""


class Port(ABC):
    """A socket of this machine that the board can be plugged into. `close` unplugs, and so does the process's end."""

    @abstractmethod
    def plug(self) -> None:
        """Make the device appear. Raises NoDevice where the kernel refuses."""

    @abstractmethod
    def unplug(self) -> None:
        """Make it disappear at once, as a pulled plug does."""

    @abstractmethod
    def send(self, report: bytes) -> bool:
        """Hand a report to the host; return whether one before it was lost for want of a host that asked."""

    @abstractmethod
    def close(self) -> None:
        """Unplug and give everything back."""

    def halt(self) -> bool:
        """Answer the next reads with a stall until the host clears it; return whether this port knows such a thing."""
        return False
