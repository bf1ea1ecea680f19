"""The messages of a tick in the protocol to the writer process: its new samples and images, and the tick itself.

Less code and fewer objects are faster here than their number suggests: a millisecond after the last tick, the
processor's cache holds few of them.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any, Final

from graspsense.core.values.signals import Command, Reading
from graspsense.recording.layout import (
    HEAD_WIRE,
    IS_SIGNAL,
    IS_TICK,
    IS_TOPIC,
    TICK,
    TICK_WIRE,
    Topic,
    pads_topic,
    signal_topics,
)

_pack_tick: Final = TICK_WIRE.pack_into


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


class TickMessages:
    """Packs ticks. `announce` is called with the message that announces a topic, before the first one of that topic."""

    def __init__(self, announce: Callable[[bytes], object]) -> None:
        self._announce_to = announce
        self._counter = 0
        self._pads: _Channel | None = None
        self._signals: list[tuple[_Channel, Callable[[Reading], tuple[Any, ...] | None]]] | None = None
        self._announced = 0
        # All messages of a tick are packed here.
        self._buffer = bytearray(TICK_WIRE.size)
        self._view = memoryview(self._buffer)

    def packed(self, reading: Reading, phase: int, command: Command) -> memoryview:
        """Return the messages of a tick, with its images and samples if those are new, until the next one is packed."""
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
        return self._view[: offset + TICK_WIRE.size]

    def _announce(self, topic: Topic) -> _Channel:
        self._announce_to(json_message(IS_TOPIC, topic.name, topic.type_name, topic.definition))
        self._announced += 1
        channel = _Channel(self._announced - 1, topic)
        # The messages that are in the buffer already stay where they are.
        self._buffer = self._buffer + bytes(channel.size)
        self._view = memoryview(self._buffer)
        return channel
