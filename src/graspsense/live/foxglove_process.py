"""The process that serves live grasps to Foxglove: the topics and schemas of a recording, by foxglove-sdk.

Each viewer gets a server of the SDK of its own, which nobody else is told of. In front of it stands a gate, since the
SDK lets in whoever connects: it asks for the token, refuses the pages of others, and drops a viewer that does not take
what it is sent or sends more than subscriptions need.

    python -m graspsense.live.foxglove_process PORT
"""

from __future__ import annotations

import asyncio
import json
import secrets
import struct
import sys
from collections import deque
from contextlib import suppress
from threading import Lock
from time import time_ns
from typing import Any, Final, cast

import foxglove
from websockets.asyncio.client import ClientConnection, connect
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import WebSocketException
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from graspsense.live.admission import FLUSH_S, HISTORY_BYTES, Address, viewer_refusal
from graspsense.live.stream import buffers
from graspsense.live.viewer_server import ViewerServer
from graspsense.recording.layout import (
    CDR_HEADER,
    IS_SIGNAL,
    IS_TICK,
    IS_TOPIC,
    TICK_SCHEMA,
    TICK_TOPIC,
    LogClock,
    Topic,
)
from graspsense.recording.wire_messages import complete_messages, leave_control_alone

WAITING_BYTES: Final = HISTORY_BYTES + (8 << 20)
"""Bytes that may wait for a viewer before it is dropped."""
MOST_SENT: Final = 1 << 20
"""Bytes that a viewer may send: it has nothing to send but subscriptions."""
BACKLOG: Final = 1 << 20
"""Messages that the SDK keeps for a viewer; more than are in `WAITING_BYTES`, so that it never leaves one out."""
HOST: Final = "127.0.0.1"
CLOSE_S: Final = 0.5
PROTOCOLS: Final = [Subprotocol("foxglove.sdk.v1"), Subprotocol("foxglove.websocket.v1")]
"""Names of the protocol: of the SDK, and the older one of which it is an extension."""
APP: Final = "https://app.foxglove.dev"
_T_S: Final = struct.Struct("<d")
Logged = tuple[int, int, bytes]
"""A message: the number of its topic, the time at which it is logged, and its bytes in CDR."""


class FoxgloveViewer:
    """One viewer of a grasp: its server of the SDK, its channels, and how much waits for it.

    It receives what it subscribes to, from the beginning of the grasp. The SDK calls `on_subscribe` and
    `on_unsubscribe` in threads of its own.
    """

    def __init__(self, grasp: RunningGrasp, transport: asyncio.WriteTransport) -> None:
        self._grasp, self._transport, self._context = grasp, transport, foxglove.Context()
        self._channels: list[foxglove.Channel] = []
        self._subscribed: set[int] = set()
        self._stopping = Lock()
        self.logged = self.sent = 0
        """Bytes that the SDK was given, and that were passed on."""
        # A page that guesses would have to find one of 2^24 addresses beside the port.
        inner = ".".join(["127", *(str(secrets.randbelow(254) + 1) for _ in range(3))])
        self.host = inner if sys.platform == "linux" else "127.0.0.1"
        self.server = foxglove.start_server(
            name="graspsense",
            host=self.host,
            port=0,
            server_listener=cast("Any", self),  # it has what a viewer can cause without further capabilities
            context=self._context,
            message_backlog_size=BACKLOG,
        )
        with grasp.lock:
            for topic in grasp.topics:
                self.announce(*topic)
            grasp.viewers.add(self)

    def stop(self) -> None:
        """Stop its server, once its viewer has answered. The end of the grasp and of the connection both do so."""
        with self._stopping:  # which the SDK refuses to do in two threads at once
            self.server.stop()

    @property
    def has_all(self) -> bool:
        """Whether it subscribes to every topic and has got what there is."""
        return len(self._subscribed) == len(self._channels) and self.logged <= self.sent

    def announce(self, name: str, type_name: str, definition: bytes) -> None:
        """Offer a further topic."""
        schema = foxglove.Schema(name=type_name, encoding="ros2msg", data=definition)
        self._channels.append(
            foxglove.Channel(name, schema=schema, message_encoding="cdr", context=self._context)
        )

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Send what there is of a topic, and from now on what comes."""
        with self._grasp.lock:
            number = [known.id() for known in self._channels].index(channel.id)
            for message in self._grasp.history:
                if message[0] == number:
                    self._log(message)
            self._subscribed.add(number)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Send no more of a topic."""
        with self._grasp.lock:
            self._subscribed.discard([known.id() for known in self._channels].index(channel.id))

    def take(self, message: Logged) -> None:
        """Send a message if its topic is subscribed to."""
        if message[0] in self._subscribed:
            self._log(message)

    def _log(self, message: Logged) -> None:
        number, log_ns, data = message
        self._channels[number].log(data, log_time=log_ns)
        self.logged += len(data) + 13  # as `sent`, with the head of the message

    def drop(self) -> None:
        """End the connection at once."""
        self._transport.abort()


class RunningGrasp:
    """The topics, the messages of the running grasp, and the viewers."""

    def __init__(self) -> None:
        self.lock = Lock()
        self.topics = [(TICK_TOPIC, *TICK_SCHEMA)]
        self.history: deque[Logged] = deque()
        self.viewers: set[FoxgloveViewer] = set()
        self._size, self._clock = 0, LogClock()

    def take(self, buffer: bytearray) -> None:
        """Pass on the complete messages of a buffer; a viewer that has not taken those before is dropped."""
        with self.lock:
            for kind, number, body in complete_messages(buffer):
                if kind == IS_TICK:
                    self._pass_on(0, body)
                elif kind == IS_SIGNAL:
                    self._pass_on(number + 1, body)
                elif kind == IS_TOPIC:
                    topic = Topic(*json.loads(body))
                    self.topics.append((topic.name, topic.type_name, topic.definition.encode()))
                    for viewer in self.viewers:
                        viewer.announce(*self.topics[-1])
                elif json.loads(body)[0] == "grasp":
                    self.history.clear()
                    self._size, self._clock = 0, LogClock()
            late = [viewer for viewer in self.viewers if viewer.logged - viewer.sent > WAITING_BYTES]
        for viewer in late:
            viewer.drop()

    def _pass_on(self, number: int, body: bytes) -> None:
        (t_s,) = _T_S.unpack_from(body)
        log_ns = self._clock.log_ns(t_s, time_ns())
        data = CDR_HEADER + body
        message = number, log_ns, data
        self.history.append(message)
        self._size += len(data)
        while self._size > HISTORY_BYTES:
            self._size -= len(self.history.popleft()[2])
        for viewer in self.viewers:
            viewer.take(message)


class Gate(ViewerServer[bytearray]):
    """Lets viewers in who name the token, and passes messages between them and their servers."""

    def __init__(self) -> None:
        super().__init__(Address("ws", HOST))
        self.grasp = RunningGrasp()

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return why a request is refused; None if it is not."""
        refusal = self.address.refusal(request.path.strip("/"), request.headers)
        refusal = refusal or viewer_refusal(request.headers, _is_known_origin, len(self.grasp.viewers))
        return None if refusal is None else connection.respond(*refusal)

    async def show(self, connection: ServerConnection) -> None:
        """Pass messages between a viewer and its server until one of them ends, or the viewer is dropped."""
        connection.transport.set_write_buffer_limits(0)  # so that what was sent has left this process
        viewer = FoxgloveViewer(self.grasp, connection.transport)
        address = f"ws://{viewer.host}:{viewer.server.port}"
        try:
            with suppress(OSError, WebSocketException):
                async with connect(
                    address, subprotocols=PROTOCOLS[:1], compression=None, max_size=None, ping_interval=None
                ) as inner:
                    tasks = [
                        asyncio.create_task(_take_from(connection, inner)),
                        asyncio.create_task(_send_to(viewer, inner, connection)),
                    ]
                    done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                    if tasks[0] in done:  # it has left, or has sent too much
                        viewer.drop()
                    for task in tasks:
                        task.cancel()
                    await asyncio.gather(*tasks, return_exceptions=True)
        finally:
            with self.grasp.lock:
                self.grasp.viewers.discard(viewer)
            # It waits until its connection has ended, which this loop has to see.
            await asyncio.to_thread(viewer.stop)

    def pass_on(self, part: bytearray) -> None:
        """Pass on the complete messages of a buffer."""
        self.grasp.take(part)

    async def end(self) -> None:
        """Let the viewers subscribe to new topics and take what is left, for a short time."""
        with suppress(TimeoutError):
            async with asyncio.timeout(FLUSH_S):
                while not all(viewer.has_all for viewer in self.grasp.viewers):
                    await asyncio.sleep(0.01)
        viewers = list(self.grasp.viewers)
        # Each waits until its viewer has answered the end.
        stops = [asyncio.to_thread(viewer.stop) for viewer in viewers]
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_S):
                await asyncio.gather(*stops)
                while self.grasp.viewers:
                    await asyncio.sleep(0.01)
        for viewer in self.grasp.viewers:
            viewer.drop()


def _is_known_origin(origin: str) -> bool:
    """Return whether this may be Foxglove: its web page, or a program that is no page of the web."""
    scheme, _, _ = origin.partition(":")
    return origin == APP or (":" in origin and scheme not in ("http", "https"))


async def _take_from(connection: ServerConnection, inner: ClientConnection) -> None:
    left = MOST_SENT
    async for message in connection:
        left -= len(message)
        if left <= 0:
            return
        await inner.send(message)


async def _send_to(viewer: FoxgloveViewer, inner: ClientConnection, connection: ServerConnection) -> None:
    async for message in inner:
        await connection.send(message)
        viewer.sent += len(message)


def main(port: str) -> int:
    """Serve viewers until the input ends."""
    leave_control_alone()
    settings = {"subprotocols": PROTOCOLS, "max_size": MOST_SENT, "ping_interval": None}
    asyncio.run(Gate().serve("--foxglove", int(port), buffers(0), **settings))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
