"""What a process of an observer receives: the messages of grasps, as dictionaries, in batches."""

from __future__ import annotations

import json
import os
import struct
import time
from collections.abc import Iterator
from typing import Any, Final

from graspsense.recording.layout import (
    IS_SIGNAL,
    IS_TICK,
    IS_TOPIC,
    PADS_TOPIC,
    SCALARS_TOPIC,
    SIGNAL_TOPIC,
    TICK,
    TICK_FIELDS,
    Topic,
)
from graspsense.recording.wire_messages import complete_messages

READ_BYTES: Final = 1 << 20
BATCH_S: Final = 0.033

Message = dict[str, Any]


def buffers(fd: int) -> Iterator[bytearray]:
    """Yield the buffer each time more has come, until the grasping program ends. Take complete messages out of it."""
    buffer = bytearray()
    while data := os.read(fd, READ_BYTES):
        buffer += data
        if len(data) < READ_BYTES:
            time.sleep(BATCH_S)
        yield buffer


def batches(fd: int, every_image: bool = False) -> Iterator[list[Message]]:
    """Yield the messages that have come since the last batch, until the grasping program ends.

    Of the images of an array, a batch has only the newest unless `every_image` is set.
    """
    decoder = _Decoder(every_image)
    for buffer in buffers(fd):
        messages = decoder.messages(buffer)
        if messages:
            yield messages


class _Decoder:
    """Turns messages of the pipe into dictionaries: ticks as columns, of an array the newest image or every one."""

    def __init__(self, every_image: bool) -> None:
        self._every_image = every_image
        self._topics: list[tuple[Topic, struct.Struct]] = []
        self._done: list[Message] = []
        self._open: dict[str, Message] = {}

    def messages(self, buffer: bytearray) -> list[Message]:
        """Return the complete messages of the buffer, in order; ticks between two others are one message."""
        self._done = []
        for kind, number, body in complete_messages(buffer):
            if kind == IS_TICK:
                self._tick(body)
            elif kind == IS_SIGNAL:
                self._signal(*self._topics[number], body)
            elif kind == IS_TOPIC:
                topic = Topic(*json.loads(body))
                self._topics.append((topic, topic.wire))
            else:
                self._close()
                name, values = json.loads(body)
                self._done.append({"kind": name, **values})
        self._close()
        return self._done

    def _close(self) -> None:
        self._done += self._open.values()
        self._open = {}

    def _columns(self, kind: str, names: tuple[str, ...]) -> Message:
        message = self._open.get(kind)
        if message is None:
            message = self._open[kind] = {"kind": kind, **{name: [] for name in names}}
        return message

    def _tick(self, body: bytes) -> None:
        columns = self._columns("ticks", TICK_FIELDS)
        for name, value in zip(TICK_FIELDS, TICK.unpack(body), strict=True):
            columns[name].append(value)

    def _signal(self, topic: Topic, wire: struct.Struct, body: bytes) -> None:
        values = wire.unpack(body)
        name = topic.name.removeprefix(SIGNAL_TOPIC)
        if topic.name == SCALARS_TOPIC:
            names = tuple(field for field, _, _ in topic.fields)
            columns = self._columns("scalars", names)
            for field, value in zip(names, values, strict=True):
                columns[field].append(value)
        elif topic.name == PADS_TOPIC:
            half = (len(values) - 2) // 2
            for side, cells in (("left", values[2 : 2 + half]), ("right", values[2 + half :])):
                self._image(f"pads_{side}", values[0], values[1], cells)
        elif topic.fields[-1][0] == "values":
            t_s, counter, new, axes = values[:4]
            rows = [list(values[4 + axes * k : 4 + axes * (k + 1)]) for k in range(new)]
            columns = self._columns(f"samples {name}", ("t_s", "counter", "values"))
            columns.update(kind="samples", name=name)
            columns["t_s"].append(t_s)
            columns["counter"].append(counter)
            columns["values"].append(rows)
        else:
            kind, number = topic.fields[-1][1:]
            cells = values[2:] if kind == "d" else struct.unpack(f"<{number}{kind}", values[2])
            self._image(name, values[0], values[1], cells)

    def _image(self, name: str, t_s: float, counter: int, cells: tuple[float, ...]) -> None:
        key = f"image {name}"
        if self._every_image and key in self._open:
            self._done.append(self._open[key])
        self._open[key] = {
            "kind": "image",
            "name": name,
            "t_s": t_s,
            "counter": counter,
            "cells": list(cells),
        }
