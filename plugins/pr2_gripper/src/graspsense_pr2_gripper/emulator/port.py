"""The interface between an emulated board and a port into the HID subsystem of this computer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple, Protocol


class Plug(NamedTuple):
    """The identity of the device on the bus."""

    vendor_id: int
    product_id: int
    serial: str
    product: str


class Device(Protocol):
    """The side of the board that its port calls, from any thread."""

    @property
    def stalled(self) -> bool:
        """Whether no transfer completes, in either direction."""

    def output(self, report: bytes) -> None:
        """Receive an output report from the host."""

    def feature(self, report_id: int) -> bytes | None:
        """Return a feature report, None if there is no such report."""


class Port(ABC):
    """A port that the board can be connected to. `close`, or the end of the process, disconnects it."""

    @abstractmethod
    def plug(self) -> None:
        """Connect the device. Raises NoDevice if the kernel refuses it."""

    @abstractmethod
    def unplug(self) -> None:
        """Disconnect the device abruptly, as pulling the plug does."""

    @abstractmethod
    def send(self, report: bytes) -> bool:
        """Pass a report to the host; return whether an earlier one was lost because the host had not read it."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect the device and release all resources."""

    def halt(self) -> bool:
        """Stall the reading endpoint until the host clears it; return whether the port supports stalls."""
        return False
