"""The hand's port 1338 on this machine, in real time: one host at a time, commands by TCP and states by UDP."""

from __future__ import annotations

import heapq
import itertools
import select
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final, final

from graspsense.gripper_api import GraspsenseError
from graspsense_franka_hand import protocol
from graspsense_franka_hand.emulator.hand import TEMPERATURE_C, FrankaHand
from graspsense_franka_hand.orders import RATE_HZ
from graspsense_franka_hand.protocol import CONNECT, HandRequest, HandRequests, NotARequest

STEP_S: Final = 0.005
"""How often the fingers move on."""
LONGEST_STEP_S: Final = 0.05
"""Most time by which the fingers move on at once: on a busy machine they are slow, and states still come."""
HOSTS: Final = tuple(f"127.0.0.{i}" for i in range(1, 33))
"""The port is fixed, so that each hand has an address of its own."""
MOST_READ: Final = 4096
"""Bytes that are read at once."""


class NoAddress(GraspsenseError):
    """Port 1338 is taken at every address of this machine."""


@final
class HandServer:
    """Serves this hand in a thread from construction to `close`. `mood()` is asked at each message.

    A second host is refused. A host that goes away leaves the fingers as they are, as a real hand does.
    """

    def __init__(
        self, hand: FrankaHand, mood: Callable[[], str], late_s: float, clock: Callable[[], float]
    ) -> None:
        self._hand, self._mood, self._late_s, self._clock = hand, mood, late_s, clock
        self._listener = _listener()
        self.where: str = self._listener.getsockname()[0]
        self._states = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._host: socket.socket | None = None
        self._state_port: tuple[str, int] | None = None
        self._requests = HandRequests()
        self._due_s = 0.0
        self._hand_s = clock()
        self._delayed: list[tuple[float, int, Callable[[], object]]] = []
        self._order = itertools.count()
        self.failed = ""
        self.refused_hosts = 0
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="emulated Franka Hand", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Pull the plug; can be called twice."""
        self._closed.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _serve(self) -> None:
        try:
            while not self._closed.is_set():
                sources = [self._listener, *([] if self._host is None else [self._host])]
                ready, _, _ = select.select(sources, [], [], STEP_S)
                # First of the present host: it may have gone, and come back.
                if self._host is not None and self._host in ready:
                    self._receive(self._host)
                if self._listener in ready:
                    self._accept()
                self._advance()
        except Exception as error:
            # The simulated fingers can be a user's code and fail; the host then sees a hand that is gone.
            self.failed = f"{type(error).__name__}: {error}"
        finally:
            self._disconnect()
            self._listener.close()
            self._states.close()

    def _accept(self) -> None:
        host = self._listener.accept()[0]
        if self._host is not None:
            self.refused_hosts += 1
            host.close()
            return
        host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._host, self._requests = host, HandRequests()

    def _receive(self, host: socket.socket) -> None:
        data = b""
        with suppress(OSError):
            data = host.recv(MOST_READ)
        if not data:
            self._disconnect()
            return
        try:
            requests = self._requests.fed(data)
        except NotARequest:
            self._disconnect()
            return
        for request in requests:
            if request.command == CONNECT:
                self._connect(host, request)
            elif self._state_port is not None:
                self._hand.ask(request, self._hand_s)

    def _connect(self, host: socket.socket, request: HandRequest) -> None:
        version, port = map(int, request.values)
        if version != protocol.VERSION or self._mood() == "old":
            self._reply(request, protocol.INCOMPATIBLE)
            return
        self._state_port = (host.getpeername()[0], port)
        self._reply(request, protocol.SUCCESS)

    def _advance(self) -> None:
        now_s = self._clock()
        self._hand_s = min(now_s, self._hand_s + LONGEST_STEP_S)
        self._hand.look(self._hand_s)
        for request, status in self._hand.ended():
            self._reply(request, status)
        if self._state_port is not None and now_s >= self._due_s:
            self._due_s = max(self._due_s + 1.0 / RATE_HZ, now_s)
            hand = self._hand
            data = protocol.state(
                round(now_s * 1e3), hand.width_m, hand.widest_m, hand.grasped, TEMPERATURE_C
            )
            where = self._state_port
            data = data[:-3] if self._mood() == "damaged" else data
            self._send(lambda: self._states.sendto(data, where))
        while self._delayed and self._delayed[0][0] <= now_s:
            with suppress(OSError):
                heapq.heappop(self._delayed)[2]()

    def _reply(self, request: HandRequest, status: int) -> None:
        host, data = self._host, protocol.reply(request, status)
        if host is not None:
            if self._mood() == "damaged":
                data = data[:-2] + b"\xff\xff"
            self._send(lambda: host.sendall(data))

    def _send(self, sends: Callable[[], object]) -> None:
        mood = self._mood()
        if mood == "silent":
            return
        due_s = self._clock() + (self._late_s if mood == "late" else 0.0)
        heapq.heappush(self._delayed, (due_s, next(self._order), sends))

    def _disconnect(self) -> None:
        if self._host is not None:
            self._host.close()
        self._host = self._state_port = None
        self._delayed.clear()
        self._hand.abort()
        self._hand.ended()


def _listener() -> socket.socket:
    """Return a socket at the port of the hand, at the first address of this machine where it is free."""
    for address in HOSTS:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((address, protocol.PORT))
            listener.listen(4)
        except OSError:
            listener.close()
            continue
        return listener
    raise NoAddress(f"port {protocol.PORT} is taken at {HOSTS[0]} to {HOSTS[-1]}: end another emulated hand")


def real_time() -> Callable[[], float]:
    """Return a clock in s that begins now."""
    began_s = time.monotonic()
    return lambda: time.monotonic() - began_s
