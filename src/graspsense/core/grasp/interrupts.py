"""Signals that end a grasp or a command. The first one ends a grasp; none interrupts the release of the gripper."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import inf
from types import FrameType, TracebackType
from typing import Any, Final

# Ctrl-C, kill, and the end of a terminal or ssh session.
ENDING: Final = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)

STUCK_S: Final = 5.0
"""Time after which a tick counts as one that never ends: what it imports or compiles at first takes less."""
LOOKS: Final = 10
"""How often a tick is looked at in this time."""


class Interrupts:
    """Within this context, the first signal raises KeyboardInterrupt; later ones are only counted in `count`.

    The way out of a grasp is therefore never interrupted, however often the user presses Ctrl-C; it may read `count`
    and hurry. While `deferred` is set, the first signal is only counted as well. Only the main thread receives
    signals; in other threads this has no effect. A signal that the process ignores stays ignored.

    After `watch`, a tick that does not end raises KeyboardInterrupt too, and `stuck` is True; it is not counted.
    """

    def __init__(self, *, deferred: bool = False) -> None:
        self.count = 0
        self.deferred = deferred
        self._previous: dict[int, Any] = {}
        self.stuck = self._raised = False
        self._tick_began_s = inf
        self._over = threading.Event()
        self._watch: threading.Thread | None = None

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            for number in ENDING:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._previous[number] = signal.signal(number, self._take)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._over.set()
        if self._watch is not None:
            self._watch.join()
        for number, previous in self._previous.items():
            signal.signal(number, previous)

    def watch(self) -> None:
        """Begin to watch the ticks, where a signal can end one."""
        if self._previous and hasattr(signal, "pthread_kill"):
            self._watch = threading.Thread(target=self._look, name="tick watch", daemon=True)
            self._watch.start()

    def tick_begins(self) -> None:
        """Note that a tick begins."""
        self._tick_began_s = time.monotonic()

    def tick_ended(self) -> None:
        """Note that no tick runs."""
        self._tick_began_s = inf

    def _look(self) -> None:
        while not self._over.wait(STUCK_S / LOOKS):
            if time.monotonic() - self._tick_began_s > STUCK_S:
                self.stuck = True
                # Also ends a sleep.
                signal.pthread_kill(threading.main_thread().ident or 0, next(iter(self._previous)))
                return

    def _take(self, number: int, frame: FrameType | None) -> None:
        if self.stuck and not self._raised:
            self._raised = True
            if self.deferred:
                # The tick has ended meanwhile, and so has the grasp.
                return
            raise KeyboardInterrupt
        self.count += 1
        previous = self._previous[number]
        if callable(previous) and previous is not signal.default_int_handler:
            # The previous handler is called too; its KeyboardInterrupt is raised below, once.
            with suppress(KeyboardInterrupt):
                previous(number, frame)
        if self.count == 1 and not self.deferred:
            raise KeyboardInterrupt


@contextmanager
def ended_like_ctrl_c() -> Iterator[None]:
    """Within this context, SIGTERM and SIGHUP raise KeyboardInterrupt, unless the process handles or ignores them.

    A command that is ended by them therefore lets go of its gripper, and removes what it has half written.
    """
    previous = {}
    if threading.current_thread() is threading.main_thread():
        for number in ENDING:
            if signal.getsignal(number) is signal.SIG_DFL:
                previous[number] = signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
