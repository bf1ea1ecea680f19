"""The process that serves live grasps to Foxglove: the topics and schemas of a recording, by foxglove-sdk.

Each viewer gets a server of the SDK of its own, which nobody else is told of. In front of it stands a gate, since the
SDK lets in whoever connects: it asks for the token, refuses the pages of others, and drops a viewer that does not take
what it is sent or sends more than subscriptions need.

    python -m graspsense.live.foxglove_process PORT
"""

from __future__ import annotations

import asyncio
import json
import re
import secrets
import struct
import sys
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from email.message import Message
from http import HTTPStatus
from http.client import HTTPException, parse_headers
from io import BytesIO
from threading import Lock
from time import time_ns
from typing import Any, Final, cast
from urllib.parse import urlsplit

import foxglove

from graspsense.live.admission import (
    FLUSH_S,
    HISTORY_BYTES,
    MOST_CONNECTIONS,
    SHAKE_TIMEOUT_S,
    Address,
    Refusal,
    say,
    viewer_refusal,
    why_not,
)
from graspsense.live.stream import buffers
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
LARGEST_HEAD: Final = 8192
PUMP_BYTES: Final = 1 << 16
CLOSE_S: Final = 0.5
PROTOCOLS: Final = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""Names of the protocol: of the SDK, and the older one of which it is an extension."""
APP: Final = "https://app.foxglove.dev"
_KEY: Final = re.compile(r"[A-Za-z0-9+/=]{24}")
_T_S: Final = struct.Struct("<d")
LOST: Final = (OSError, EOFError, ValueError, RuntimeError, asyncio.LimitOverrunError, HTTPException)
"""How a connection ends that breaks off, is too slow or says something wrong. RuntimeError is the SDK's."""

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
        # As `sent`, with the head of the message and that of its WebSocket frame.
        size = len(data) + 13
        self.logged += size + (2 if size < 126 else 4 if size < 65536 else 10)

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


class Gate:
    """Lets viewers in who name the token, and passes bytes between them and their servers."""

    def __init__(self) -> None:
        self.address, self.grasp = Address("ws", HOST), RunningGrasp()
        self._connected = 0

    async def answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Answer a connection until it ends."""
        self._connected += 1
        try:
            if self._connected <= MOST_CONNECTIONS:
                await self._shake(reader, writer)
        finally:
            self._connected -= 1
            writer.close()

    async def _shake(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(*LOST):
            async with asyncio.timeout(SHAKE_TIMEOUT_S):
                request, headers = _head(await reader.readuntil(b"\r\n\r\n"))
            refusal = self._refusal(request, headers)
            if refusal is not None:
                status, reason = refusal
                text = f"HTTP/1.1 {status.value} {status.phrase}\r\nContent-Type: text/plain\r\n"
                writer.write(
                    f"{text}Content-Length: {len(reason)}\r\nConnection: close\r\n\r\n{reason}".encode()
                )
                return
            writer.transport.set_write_buffer_limits(0)  # so that what was sent has left this process
            viewer = FoxgloveViewer(self.grasp, writer.transport)
            try:
                await _served(viewer, headers, reader, writer)
            finally:
                with self.grasp.lock:
                    self.grasp.viewers.discard(viewer)
                # It waits until its connection has ended, which this loop has to see.
                await asyncio.to_thread(viewer.server.stop)

    def _refusal(self, request: Sequence[str], headers: Message) -> Refusal | None:
        if len(request) != 3 or request[0] != "GET":
            return HTTPStatus.BAD_REQUEST, "this is an address for Foxglove\n"
        refusal = self.address.refusal(request[1].strip("/"), headers)
        if refusal is not None:
            return refusal
        if _protocol(headers) is None or not _KEY.fullmatch(headers.get("Sec-WebSocket-Key", "")):
            return HTTPStatus.BAD_REQUEST, "this is an address for Foxglove: open it there\n"
        return viewer_refusal(headers, _is_known_origin, len(self.grasp.viewers))

    async def end(self) -> None:
        """Let the viewers subscribe to new topics and take what is left, for a short time."""
        with suppress(TimeoutError):
            async with asyncio.timeout(FLUSH_S):
                while not all(viewer.has_all for viewer in self.grasp.viewers):
                    await asyncio.sleep(0.01)
        viewers = list(self.grasp.viewers)
        # Each waits until its viewer has answered the end.
        stops = [asyncio.to_thread(viewer.server.stop) for viewer in viewers]
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_S):
                await asyncio.gather(*stops)
                while self.grasp.viewers:
                    await asyncio.sleep(0.01)
        for viewer in self.grasp.viewers:
            viewer.drop()


def _head(data: bytes) -> tuple[list[str], Message]:
    """Return the words of the first line of a head of HTTP, and its headers. Raises HTTPException for other data."""
    line, _, header_lines = data.partition(b"\r\n")
    return line.decode("latin-1").split(" "), parse_headers(BytesIO(header_lines))


def _protocol(headers: Message) -> str | None:
    """Return the protocol that a viewer is answered in: the newest that it asks for."""
    asked = {word.strip() for word in headers.get("Sec-WebSocket-Protocol", "").split(",")}
    return next((name for name in PROTOCOLS if name in asked), None)


def _is_known_origin(origin: str) -> bool:
    """Return whether this may be Foxglove: its web page, or a program that is no page of the web."""
    return origin == APP or urlsplit(origin).scheme not in ("", "http", "https")


async def _served(
    viewer: FoxgloveViewer, headers: Message, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
) -> None:
    """Pass bytes between a viewer and its server until one of them ends, or the viewer is dropped."""
    inner_reader, inner_writer = await asyncio.open_connection(viewer.host, viewer.server.port)
    try:
        key = headers["Sec-WebSocket-Key"]
        inner_writer.write(
            f"GET / HTTP/1.1\r\nHost: {viewer.host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"
            f"Sec-WebSocket-Protocol: {PROTOCOLS[0]}\r\n\r\n".encode()
        )
        _, answer = _head(await inner_reader.readuntil(b"\r\n\r\n"))
        writer.write(
            "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Accept: {answer['Sec-WebSocket-Accept']}\r\n"
            f"Sec-WebSocket-Protocol: {_protocol(headers)}\r\n\r\n".encode()
        )
        tasks = [
            asyncio.create_task(_take_from(reader, inner_writer)),
            asyncio.create_task(_send_to(viewer, inner_reader, writer)),
        ]
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        if tasks[0] in done:  # it has left, or has sent too much
            viewer.drop()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    finally:
        inner_writer.transport.abort()


async def _take_from(reader: asyncio.StreamReader, inner: asyncio.StreamWriter) -> None:
    left = MOST_SENT
    while left > 0 and (data := await reader.read(PUMP_BYTES)):
        left -= len(data)
        inner.write(data)
        await inner.drain()


async def _send_to(viewer: FoxgloveViewer, inner: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await inner.read(PUMP_BYTES):
        writer.write(data)
        await writer.drain()
        viewer.sent += len(data)


async def serve_foxglove(port: int) -> None:
    """Serve until standard input ends. Prints one line of JSON: the address, or why there is none."""
    gate, loop = Gate(), asyncio.get_running_loop()
    try:
        server = await asyncio.start_server(gate.answer, HOST, port, limit=LARGEST_HEAD)
    except OSError as error:
        say({"error": why_not("--foxglove", HOST, port, error)})
        return
    gate.address.port = server.sockets[0].getsockname()[1]
    say({"address": gate.address.text})
    incoming = buffers(0)
    while (buffer := await loop.run_in_executor(None, next, incoming, None)) is not None:
        gate.grasp.take(buffer)
    server.close()
    await gate.end()


def main(port: str) -> int:
    """Serve viewers until the input ends."""
    leave_control_alone()
    asyncio.run(serve_foxglove(int(port)))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
