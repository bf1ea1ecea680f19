"""Where an emulated device can be reached: a pseudo-terminal, or a socket of this machine. One thread serves it."""

from __future__ import annotations

import os
import select
import socket
import threading
import tty
from collections.abc import Callable
from contextlib import suppress
from typing import Final, final

LARGEST: Final = 4096
MOST_UNSENT: Final = 1 << 16
"""Bytes that wait for a host which does not read; more is lost, as from a device with a buffer."""


@final
class EmulatedPort:
    """A port on a `pty` or a `socket`; `heard(data)` is called with what arrives, and returns what is sent back.

    `idle` is called at most every `period_s`, where that is given, and returns what is sent unasked.
    """

    def __init__(
        self,
        wire: str,
        heard: Callable[[bytes], bytes],
        idle: Callable[[], bytes] | None = None,
        period_s: float | None = None,
    ) -> None:
        self._heard, self._idle, self._period_s = heard, idle, period_s
        self._door: socket.socket | None = None
        self._call: socket.socket | None = None
        self._terminal: tuple[int, int] | None = None
        self._unsent = b""
        if wire == "pty":
            self._terminal = os.openpty()
            for end in self._terminal:
                tty.setraw(end)
            os.set_blocking(self._terminal[0], False)
            self.where = os.ttyname(self._terminal[1])
        else:
            self._door = socket.create_server(("127.0.0.1", 0))
            self.where = f"socket:127.0.0.1:{self._door.getsockname()[1]}"
        # Sockets: unlike the number of a pipe, a closed one cannot be another file by now.
        self._wake = socket.socketpair()
        self._closed = False
        self._thread = threading.Thread(target=self._serve, name="emulated port", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Pull the plug; can be called twice, and by what `heard` does."""
        if self._closed:
            return
        self._closed = True
        with suppress(OSError):
            self._wake[1].send(b"x")
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _serve(self) -> None:
        try:
            while not self._closed:
                sources = [self._wake[0].fileno(), *self._sources()]
                ready, _, _ = select.select(sources, [], [], self._period_s)
                if self._door is not None and self._door.fileno() in ready:
                    self._accept()
                elif set(ready) & set(self._sources()):
                    self._hear()
                unasked = b"" if self._idle is None else self._idle()
                if unasked or self._unsent:
                    self._send(unasked)
        finally:
            self._release()

    def _sources(self) -> list[int]:
        if self._terminal is not None:
            return [self._terminal[0]]
        assert self._door is not None
        return [self._door.fileno(), *([] if self._call is None else [self._call.fileno()])]

    def _accept(self) -> None:
        assert self._door is not None
        # A newer host replaces an older one, as on a converter that has one connection.
        if self._call is not None:
            self._call.close()
        self._call = self._door.accept()[0]
        self._call.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _hear(self) -> None:
        data = b""
        with suppress(OSError):
            data = self._call.recv(LARGEST) if self._call is not None else os.read(self._handle(), LARGEST)
        if data:
            # Who asks does not want what waited for somebody else.
            self._unsent = b""
            reply = self._heard(data)
            if reply and not self._closed:
                self._send(reply)
        elif self._call is not None:
            self._call.close()
            self._call = None

    def _handle(self) -> int:
        assert self._terminal is not None
        return self._terminal[0]

    def _send(self, data: bytes) -> None:
        with suppress(OSError):
            if self._terminal is not None:
                # A terminal fills up where nobody reads.
                if len(self._unsent) <= MOST_UNSENT:
                    self._unsent += data
                if select.select([], [self._handle()], [], 0.0)[1]:
                    self._unsent = self._unsent[os.write(self._handle(), self._unsent) :]
            elif self._call is not None:
                self._call.sendall(data)

    def _release(self) -> None:
        for end in self._terminal or ():
            os.close(end)
        for connection in (self._door, self._call, *self._wake):
            if connection is not None:
                connection.close()
