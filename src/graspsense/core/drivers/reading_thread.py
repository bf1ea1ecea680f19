"""Reading a device in a thread of its own: the newest value is at hand, and none waits in a buffer.

A device that sends on its own is read without pause. Who asks gets the newest value, its age, and what ended the
thread; values that a newer one replaced are counted.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from math import inf
from typing import Generic, TypeVar, final

ValueT = TypeVar("ValueT")


@final
class ReadingThread(Generic[ValueT]):
    """Calls `read` again and again in a daemon thread that starts at construction, until `close`.

    `read` returns a value, or None if none came for a short time; it must return within a second, so that the thread
    can end. What it raises ends the thread, and `newest` raises it. `joined(before, now)` returns the value that
    stands for two of which the first was not asked for in time; without it, that is the later one.
    """

    def __init__(
        self,
        read: Callable[[], ValueT | None],
        *,
        name: str = "reader",
        joined: Callable[[ValueT, ValueT], ValueT] | None = None,
    ) -> None:
        self._read, self._joined = read, joined
        self._arrived = threading.Condition()
        self._stop = threading.Event()
        self._newest: ValueT | None = None
        self._error: BaseException | None = None
        self._arrived_s = -inf
        self.replaced = 0
        """The number of values that a newer one replaced before `newest` returned them."""
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def newest(self, timeout_s: float) -> ValueT | None:
        """Return the newest value that was not returned yet, or None if none comes within `timeout_s`.

        Raises what `read` raised, once the values before were returned.
        """
        until_s = time.monotonic() + timeout_s
        with self._arrived:
            while self._newest is None:
                if self._error is not None:
                    raise self._error
                left_s = until_s - time.monotonic()
                if left_s <= 0.0:
                    return None
                self._arrived.wait(left_s)
            newest, self._newest = self._newest, None
            return newest

    def age_s(self) -> float:
        """Return the time (s) since the last value arrived; inf before the first."""
        return time.monotonic() - self._arrived_s

    def close(self, timeout_s: float = 1.0) -> bool:
        """End the thread, also twice; return whether it ended in time. One that hangs in `read` is abandoned."""
        self._stop.set()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                value = self._read()
                if value is not None:
                    self._take(value)
        except BaseException as error:
            with self._arrived:
                self._error = error
                self._arrived.notify_all()

    def _take(self, value: ValueT) -> None:
        with self._arrived:
            self._arrived_s = time.monotonic()
            if self._newest is not None:
                self.replaced += 1
                if self._joined is not None:
                    value = self._joined(self._newest, value)
            self._newest = value
            self._arrived.notify_all()
