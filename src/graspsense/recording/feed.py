"""Ticks for another process: each is one non-blocking write to a pipe, and no tick waits.

Messages that the pipe does not take are queued and offered again with the next ticks; what is beyond the limits of the
queue is dropped and counted.
"""

from __future__ import annotations

import fcntl
import json
import os
import select
import struct
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, Final

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.signals import Command, Reading
from graspsense.recording.layout import (
    HEAD_WIRE,
    IS_METADATA,
    IS_SIGNAL,
    IS_TICK,
    IS_TOPIC,
    TICK,
    TICK_WIRE,
    Topic,
    pads_topic,
    signal_topics,
)

PIPE_BYTES: Final = 1 << 20
RETRIES_PER_TICK: Final = 8
"""Queued messages offered with each new one; the limit keeps a tick short."""
QUEUE_LIMIT: Final = 500_000
"""Limit on the messages that wait for the pipe; what is beyond it is dropped, and counted."""

Data = bytes | memoryview
_pack_tick: Final = TICK_WIRE.pack_into
_MOST_BEFORE_A_TICK: Final = select.PIPE_BUF - TICK_WIRE.size
"""Bytes of other messages beside a tick up to which a write is atomic."""


def json_message(kind: bytes, *values: Any) -> bytes:
    """Return the message of this kind that passes JSON values."""
    body = json.dumps(values).encode()
    return HEAD_WIRE.pack(kind, len(body), 0) + body


class _Channel:
    """A topic that was announced to the writer process under a number: what packs a message with all its numbers.

    `pack_into(buffer, at, *head, *numbers)` writes the message in the protocol to the writer process.
    """

    def __init__(self, number: int, topic: Topic) -> None:
        body = topic.wire
        wire = struct.Struct(HEAD_WIRE.format + body.format.removeprefix("<"))
        self.head = (IS_SIGNAL, body.size, number)
        self.pack_into, self.size = wire.pack_into, wire.size


class Feed:
    """A sink of the runner that passes ticks, images and samples to `python -m MODULE ARGUMENTS` on its standard input.

    `queue_bytes` limits the messages that wait for the pipe. Raises SaveFailed if the process cannot be started. After
    that, `take` never raises: another process must not stop a grasp.
    """

    def __init__(self, module: str, arguments: Sequence[str], queue_bytes: int) -> None:
        # -P: do not import a file mcap.py from the current folder.
        command = [sys.executable, "-P", "-m", module, *arguments]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                bufsize=0,
                start_new_session=True,
            )
        except OSError as error:
            raise SaveFailed(f"cannot start {module}: {error.strerror}") from error
        assert self._process.stdin is not None
        self._fd = self._process.stdin.fileno()
        os.set_blocking(self._fd, False)
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):  # the user's limit of pipe memory
                fcntl.fcntl(self._fd, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes, self._queue_bytes = 0, queue_bytes
        self._counter = 0
        self._pads: _Channel | None = None
        self._signals: list[tuple[_Channel, Callable[[Reading], tuple[Any, ...] | None]]] | None = None
        self._announced = 0
        self.ticks = 0
        """Ticks that were taken."""
        # All messages of a tick are packed here and written at once. Less code and fewer objects are faster here than
        # their number suggests: a millisecond after the last tick, the processor's cache holds few of them.
        self._buffer = bytearray(TICK_WIRE.size)
        self._view = memoryview(self._buffer)
        self._broken = False
        self._deferred = self._most_waiting = self._dropped = 0

    def _first_line(self, timeout_s: float) -> bytes | None:
        """Return the first line that the process prints: empty if it ends without one, None if none comes in time."""
        assert self._process.stdout is not None
        out, said, until = self._process.stdout.fileno(), b"", time.monotonic() + timeout_s
        while not said.endswith(b"\n"):
            if not select.select([out], [], [], max(0.0, until - time.monotonic()))[0]:
                return None
            data = os.read(out, 4096)
            if not data:
                return b""
            said += data
        return said

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        """Pass on one tick, with its images and samples if those are new."""
        frame, pads, signals = reading
        offset = 0
        if signals:
            if self._signals is None:
                self._signals = [(self._announce(topic), source) for topic, source in signal_topics(signals)]
            for channel, source in self._signals:
                numbers = source(reading)
                if numbers is not None:
                    channel.pack_into(self._buffer, offset, *channel.head, *numbers)
                    offset += channel.size
        if pads.counter != self._counter:
            self._counter = pads.counter
            if self._pads is None:
                self._pads = self._announce(pads_topic(len(pads.left)))
            channel = self._pads
            t_s, counter, left, right = pads
            channel.pack_into(self._buffer, offset, *channel.head, t_s, counter, *left, *right)
            offset += channel.size
        _pack_tick(self._buffer, offset, IS_TICK, TICK.size, 0, *frame, phase, *command)
        data = self._view[: offset + TICK_WIRE.size]
        if self._waiting or offset > _MOST_BEFORE_A_TICK:
            self._send(data)
        elif not self._broken:
            # As `_send`, without the two calls.
            try:
                os.write(self._fd, data)
            except BlockingIOError:
                self._defer(data)
            except OSError:
                self._broken = True
        self.ticks += 1

    def _announce(self, topic: Topic) -> _Channel:
        self._send(json_message(IS_TOPIC, topic.name, topic.type_name, topic.definition))
        self._announced += 1
        channel = _Channel(self._announced - 1, topic)
        # The messages that are in the buffer already stay where they are.
        self._buffer = self._buffer + bytes(channel.size)
        self._view = memoryview(self._buffer)
        return channel

    def _told(self, name: str, values: Any) -> None:
        """Pass on JSON values under a name."""
        self._send(json_message(IS_METADATA, name, values))

    def _send(self, data: Data) -> None:
        waiting = self._waiting
        if waiting:
            self._defer(data)
            for _ in range(RETRIES_PER_TICK):
                if not waiting or not self._write(waiting[0]):
                    return
                self._waiting_bytes -= len(waiting.popleft())
        elif not self._write(data):
            self._defer(data)

    def _defer(self, data: Data) -> None:
        if len(self._waiting) >= QUEUE_LIMIT or self._waiting_bytes + len(data) > self._queue_bytes:
            self._dropped += 1
            return
        self._waiting.append(bytes(data))
        self._waiting_bytes += len(data)
        self._deferred += 1
        self._most_waiting = max(self._most_waiting, len(self._waiting))

    def _write(self, data: Data) -> bool:
        """Write to the pipe. Return whether it took the data; a pipe without a reader counts as taking everything.

        What it does not take of data that are longer than `PIPE_BUF` is written first with the next tick.
        """
        if self._broken:
            return True
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            return False
        except OSError:
            self._broken = True
            return True
        if written < len(data):
            unwritten = bytes(data[written:])
            if self._waiting and self._waiting[0] is data:
                self._waiting[0] = unwritten
                self._waiting_bytes -= written
                return False
            self._waiting.appendleft(unwritten)
            self._waiting_bytes += len(unwritten)
        return True

    def _drain(self, last: bytes, timeout_s: float) -> None:
        """Write the queue and this message, for at most `timeout_s`, while the pipe has a reader."""
        until = time.monotonic() + timeout_s
        view = memoryview(b"".join((*self._waiting, last)))
        self._waiting.clear()
        self._waiting_bytes = 0
        while view and not self._broken:
            if not select.select([], [self._fd], [], max(0.0, until - time.monotonic()))[1]:
                self._broken = True
                return
            try:
                view = view[os.write(self._fd, view) :]
            except BlockingIOError:
                continue
            except OSError:
                self._broken = True
