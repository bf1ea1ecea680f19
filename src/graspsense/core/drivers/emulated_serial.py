"""Devices that software emulates on this machine: what each has, and one behind a pseudo-terminal or a socket.

A plugin makes a device, and `graspsense emulate` runs it. It can be plugged in and unplugged; one on a line has faults.
"""

from __future__ import annotations

import os
import select
import socket
import threading
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf
from typing import ClassVar, Final, Generic, Literal, NamedTuple, final

from attrs import frozen

from graspsense.core.components.setting import setting
from graspsense.core.drivers.emulated_body import HandT


class EmulatedDevice(ABC):
    """An emulated device, which exists from the first `plug` to the end of its process, however that ends.

    `wire` is the interface of the operating system in use, `rate_hz` the rate of its reports, and `moods` the ways in
    which it can be told to behave, with their effects. Unplugged, it keeps its power.
    """

    wire: str
    rate_hz: float
    moods: ClassVar[Mapping[str, str]]
    _told = ""
    """The mood that it was told last."""

    @property
    def words(self) -> Mapping[str, str]:
        """The words that `tell` understands, with their effects."""
        return {"plug": "plug it in", "unplug": "pull the plug; the gripper keeps its power", **self.moods}

    def tell(self, word: str) -> None:
        """Execute one of `words`. Raises KeyError for any other, NoDevice if it cannot be plugged in."""
        if word in self.moods:
            self._told = word
        else:
            {"plug": self.plug, "unplug": self.unplug}[word]()

    @abstractmethod
    def plug(self) -> None:
        """Plug it in. Raises NoDevice if it cannot be."""

    @abstractmethod
    def unplug(self) -> None:
        """Pull the plug; do nothing if it is pulled."""

    @abstractmethod
    def state(self) -> Mapping[str, float | int | str | bool]:
        """Return its state; `failed` is the reason if it ended by itself, empty while it runs."""

    @abstractmethod
    def close(self) -> None:
        """Unplug it and release all resources."""


MOST_READ: Final = 4096
"""Bytes that are read at once."""
MOST_UNSENT: Final = 1 << 16
"""Bytes that wait for a host which does not read; more is lost, as from a device with a buffer."""


@final
class EmulatedPort:
    """A port on a `pty` or a `socket`; `heard(data)` is called with what arrives, and returns what is sent back.

    `idle` is called at most every `period_s`, where that is given, and returns what is sent unasked. `listener` is the
    socket that hosts connect to, if it is not any of this machine. A newer host replaces an older one, as on a
    converter that has one connection; where `gone` is given, the older one keeps the port, and `gone` is called when
    it has left.
    """

    def __init__(
        self,
        wire: str,
        heard: Callable[[bytes], bytes],
        idle: Callable[[], bytes] | None = None,
        period_s: float | None = None,
        *,
        listener: socket.socket | None = None,
        gone: Callable[[], None] | None = None,
    ) -> None:
        self._heard, self._idle, self._period_s, self._gone = heard, idle, period_s, gone
        self.refused = 0
        """The number of hosts that were refused."""
        self._listener: socket.socket | None = None
        self._connection: socket.socket | None = None
        self._terminal: tuple[int, int] | None = None
        self._unsent = b""
        if wire == "pty":
            self._terminal = os.openpty()
            for end in self._terminal:
                tty.setraw(end)
            os.set_blocking(self._terminal[0], False)
            self.where = os.ttyname(self._terminal[1])
        else:
            self._listener = listener or socket.create_server(("127.0.0.1", 0))
            self.where = "socket:{}:{}".format(*self._listener.getsockname())
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
                asked = self._listener is not None and self._listener.fileno() in ready
                # First of the present host: it may have gone, and come back.
                if set(ready) & set(self._sources()[asked:]):
                    self._receive()
                if asked:
                    self._accept()
                unasked = b"" if self._idle is None else self._idle()
                if unasked or self._unsent:
                    self._send(unasked)
        finally:
            self._release()

    def _sources(self) -> list[int]:
        if self._terminal is not None:
            return [self._terminal[0]]
        assert self._listener is not None
        return [self._listener.fileno(), *([] if self._connection is None else [self._connection.fileno()])]

    def _accept(self) -> None:
        assert self._listener is not None
        connection = self._listener.accept()[0]
        if self._connection is not None and self._gone is not None:
            self.refused += 1
            connection.close()
            return
        if self._connection is not None:
            self._connection.close()
        self._connection = connection
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _receive(self) -> None:
        data = b""
        with suppress(OSError):
            data = (
                self._connection.recv(MOST_READ)
                if self._connection is not None
                else os.read(self._handle(), MOST_READ)
            )
        if data:
            # A host that asks does not want what was sent to an earlier one.
            self._unsent = b""
            reply = self._heard(data)
            if reply and not self._closed:
                self._send(reply)
        elif self._connection is not None:
            self._connection.close()
            self._connection = None
            if self._gone is not None:
                self._gone()

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
            elif self._connection is not None:
                self._connection.sendall(data)

    def _release(self) -> None:
        for end in self._terminal or ():
            os.close(end)
        for connection in (self._listener, self._connection, *self._wake):
            if connection is not None:
                connection.close()


KEEP_UP_S: Final = 0.02
"""How often the fingers move on without a request, so that the next one need not wait until they have."""


@frozen(kw_only=True)
class EmulatorFaults:
    """Faults of an emulated gripper, by default none. Times are counted from its activation.

    A subclass says by a `Literal` type of `mood` which moods it has.
    """

    unplug_at_s: float = setting(
        default=inf, unit="s", minimum=0.0, meaning="Time at which the cable is pulled; inf: never."
    )
    mood: str = setting(default="well", meaning="How it behaves.")
    mood_at_s: float = setting(default=0.0, unit="s", minimum=0.0, meaning="Time from which on mood acts.")
    late_s: float = setting(
        default=0.3,
        unit="s",
        above=0.0,
        plausible=(1e-4, 10.0),
        meaning="Time by which what it sends is late.",
    )

    def mood_at(self, active_s: float) -> str:
        """Return the mood after this time (s) of activity."""
        return self.mood if active_s >= self.mood_at_s else "well"


@frozen(kw_only=True)
class SerialFaults(EmulatorFaults):
    """Faults of an emulated gripper on a line, by default none."""

    mood: Literal["well", "silent", "damaged", "late", "repeated"] = setting(
        default="well",
        meaning="silent: no reply. damaged: a bit of each reply is flipped. late: each reply comes after late_s. "
        "repeated: each reply comes twice.",
    )


class LateReply(NamedTuple):
    """The bytes of a reply, and by how much (s) they come late."""

    data: bytes
    late_s: float


class EmulatedSerial(EmulatedDevice, Generic[HandT]):
    """A device behind an `EmulatedPort`, in the time (s) of the host since it was made.

    A subclass answers requests, and `hand` moves its fingers; both are called under a lock, never at the same time.
    What they raise ends the device as a lost one, since the body of the fingers can be a user's code.
    """

    moods: ClassVar[Mapping[str, str]] = {
        "well": "behave again",
        "silent": "take requests, but send no replies",
        "damaged": "flip a bit of each reply",
        "late": "send each reply late",
        "repeated": "send each reply twice",
    }

    def __init__(self, wire: str, faults: EmulatorFaults, hand: HandT) -> None:
        self.wire, self.hand = wire, hand
        self._faults = faults
        self._lock = threading.Lock()
        self._began_s = time.monotonic()
        self._port: EmulatedPort | None = None
        self._failed = ""
        self._requests = 0

    @abstractmethod
    def answer(self, data: bytes, now_s: float) -> bytes:
        """Return the replies to the requests that these bytes complete; `b""` forgets what is incomplete."""

    @abstractmethod
    def details(self) -> Mapping[str, float | int | str | bool]:
        """Return what `state` tells besides the port, gap and effort."""

    def active_s(self, now_s: float) -> float:
        """Return for how long (s) the device has been active; -inf if it is not."""
        return now_s - self.hand.active_since_s

    def reply(self, data: bytes, now_s: float) -> LateReply | None:
        """Return what comes on the line after these bytes, with the faults of the line; None: the cable is pulled."""
        if self.active_s(now_s) >= self._faults.unplug_at_s:
            return None
        reply = self.answer(data, now_s)
        self._requests += bool(reply)
        return self._as_sent(reply, now_s)

    def unasked(self, now_s: float) -> bytes:
        """Return what the device sends by itself at this time, up to which the fingers have moved."""
        return b""

    def opened_port(self) -> EmulatedPort:
        """Return the port that it has when it is plugged in."""
        return EmulatedPort(self.wire, self._heard, self._moved_on, KEEP_UP_S)

    @property
    def where(self) -> str:
        """What `gripper.port` has to be, empty while it is unplugged."""
        return "" if self._port is None else self._port.where

    def plug(self) -> None:
        """Plug it in, as a new port, unless it is."""
        if self._port is None:
            self.answer(b"", self._now_s())
            self._port = self.opened_port()

    def unplug(self) -> None:
        """Pull the plug, unless it is pulled."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def state(self) -> Mapping[str, float | int | str | bool]:
        """Return where it is reached, and the state of its fingers."""
        with self._lock:
            if not self._failed:
                self.hand.look(self._now_s())
            return {
                "port": self.where,
                "plugged": self._port is not None,
                "mood": self._mood_at(self._now_s()),
                "requests": self._requests,
                "gap_m": round(self.hand.fingers.gap_m, 5),
                "effort_n": round(self.hand.fingers.effort_n, 3),
                **self.details(),
                "failed": self._failed,
            }

    def close(self) -> None:
        """Unplug it and release the body."""
        self.unplug()
        self.hand.fingers.close()

    def _now_s(self) -> float:
        return time.monotonic() - self._began_s

    def _mood_at(self, now_s: float) -> str:
        return self._told or self._faults.mood_at(self.active_s(now_s))

    def _as_sent(self, data: bytes, now_s: float) -> LateReply:
        """Return what becomes of this data on the line."""
        mood = self._mood_at(now_s)
        if mood == "silent":
            data = b""
        elif mood == "damaged" and data:
            data = data[:-3] + bytes([data[-3] ^ 1]) + data[-2:]
        return LateReply(
            data * 2 if mood == "repeated" else data, self._faults.late_s if mood == "late" else 0.0
        )

    def _heard(self, data: bytes) -> bytes:
        return self._sent(lambda now_s: self.reply(data, now_s))

    def _moved_on(self) -> bytes:
        return self._sent(self._moved)

    def _moved(self, now_s: float) -> LateReply:
        self.hand.look(now_s)
        return self._as_sent(self.unasked(now_s), now_s)

    def _sent(self, made: Callable[[float], LateReply | None]) -> bytes:
        with self._lock:
            try:
                reply = made(self._now_s())
            except Exception as error:
                self._failed = f"{type(error).__name__}: {error}"
                reply = None
        if reply is None:
            self.unplug()
            return b""
        if reply.late_s and reply.data:
            threading.Event().wait(reply.late_s)
        return reply.data
