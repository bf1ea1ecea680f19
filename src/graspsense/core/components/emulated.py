"""A device that software emulates on this machine: a plugin makes it, and `graspsense emulate` runs it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping


class EmulatedDevice(ABC):
    """An emulated device, which exists from the first `plug` to the end of its process, however that ends.

    `wire` is the interface of the operating system in use, `rate_hz` the rate of its reports.
    """

    wire: str
    rate_hz: float

    @property
    @abstractmethod
    def words(self) -> Mapping[str, str]:
        """The words that `tell` understands, with their effects; at least `plug` and `unplug`."""

    @abstractmethod
    def tell(self, word: str) -> None:
        """Execute one of `words`. Raises KeyError for any other, NoDevice if it cannot be plugged in."""

    @abstractmethod
    def state(self) -> Mapping[str, float | int | str | bool]:
        """Return its state; `failed` is the reason if it ended by itself, empty while it runs."""

    @abstractmethod
    def close(self) -> None:
        """Unplug it and release all resources."""
