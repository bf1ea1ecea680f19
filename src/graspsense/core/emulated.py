"""A device in software that is one of this machine's, as its plugin makes it and `graspsense emulate` runs it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping


class EmulatedDevice(ABC):
    """It is there from the first `plug` on, and gone with its process, however that ends.

    `wire` is the way into the operating system that it took, `rate_hz` that of its reports.
    """

    wire: str
    rate_hz: float

    @property
    @abstractmethod
    def words(self) -> Mapping[str, str]:
        """What it can be told, and what that does; `plug` and `unplug` at least."""

    @abstractmethod
    def tell(self, word: str) -> None:
        """Do one of `words`. Raises KeyError for any other, NoDevice where it cannot be plugged in."""

    @abstractmethod
    def state(self) -> Mapping[str, float | int | str | bool]:
        """Return how it is; under `failed` why it ended by itself, empty while it runs."""

    @abstractmethod
    def close(self) -> None:
        """Unplug it and give everything back."""
