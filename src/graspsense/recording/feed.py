"""Ticks for another process: each is one non-blocking write to a pipe, and no tick waits.

What the pipe does not take waits, and is offered again with the next tick; messages beyond a limit are dropped and
counted.
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

    `queue_bytes` limits what waits for the pipe. Raises SaveFailed if the process cannot be started. After
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
        self._waiting, self._queue_bytes = bytearray(), queue_bytes
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
        self._keep(data)
        if self._waiting or offset > _MOST_BEFORE_A_TICK:
            self._send(data)
        elif not self._broken:
            # As `_send`, without the call.
            try:
                os.write(self._fd, data)
            except BlockingIOError:
                self._send(data)
            except OSError:
                self._broken = True
        self.ticks += 1

    def _keep(self, data: Data) -> None:
        """Take what is passed on, also if the pipe does not."""

    def _announce(self, topic: Topic) -> _Channel:
        self._pass_on(json_message(IS_TOPIC, topic.name, topic.type_name, topic.definition))
        self._announced += 1
        channel = _Channel(self._announced - 1, topic)
        # The messages that are in the buffer already stay where they are.
        self._buffer = self._buffer + bytes(channel.size)
        self._view = memoryview(self._buffer)
        return channel

    def _told(self, name: str, values: Any) -> None:
        """Pass on JSON values under a name."""
        self._pass_on(json_message(IS_METADATA, name, values))

    def _pass_on(self, data: Data) -> None:
        self._keep(data)
        self._send(data)

    def _send(self, data: Data) -> None:
        """Write what waits, and this, as far as the pipe takes it; without a reader, it counts as taking everything."""
        waiting = self._waiting
        if self._broken:
            return
        if len(waiting) + len(data) > self._queue_bytes:
            self._dropped += 1
        else:
            waiting += data
        try:
            del waiting[: os.write(self._fd, waiting)]
        except BlockingIOError:
            pass
        except OSError:
            self._broken = True
            return
        self._deferred += bool(waiting)
        self._most_waiting = max(self._most_waiting, len(waiting))

    def _drain(self, last: bytes, timeout_s: float) -> None:
        """Write the queue and this message, for at most `timeout_s`, while the pipe has a reader."""
        until = time.monotonic() + timeout_s
        view = memoryview(bytes(self._waiting) + last)
        self._waiting.clear()
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
