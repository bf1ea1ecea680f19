"""ROS bags and MCAP files of ROS messages as tables, read by rosbags.

Every number in a message is a column, `/topic.field.field`; an array of numbers is a column with components. The rows
are the messages of the topic, among those that are used, that has the most; each other topic holds its last value.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from numpy.typing import NDArray

from graspsense.core.values.errors import ConfigError, DataDamaged, PluginUnavailable
from graspsense.recording.mcap_records import records_in, records_of
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.manifest.table import ColumnTable, Numbers
from graspsense.sources.ros_bags import Definitions, opened_bag, stamp_ns

MOST_COMPONENTS: Final = 4096
"""An array with more numbers is a picture, and is left out."""
_READ: Final = ("ros2msg", "cdr")
"""The encodings of a schema and of its messages that are read."""
_NUMBER_BYTES: Final = 100
"""Bytes of a single number of a message in memory, with its name, about."""


def read_bag(path: Path, topics: Collection[str] = ()) -> list[ColumnTable]:
    """Return the numbers in a ROS 1 bag, a folder of a ROS 2 bag, or an MCAP file.

    `topics` are those to read; with none, all. Raises PluginUnavailable without rosbags, ConfigError, DataDamaged.
    """
    if not path.exists():
        raise ConfigError(f"{path} cannot be read: there is no such file")
    messages: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    kept = Unpacked(path)
    for topic, t_ns, message in _messages(path, topics):
        numbers_in = dict(_numbers_in(message, topic))
        kept.add(sum(_NUMBER_BYTES + 8 * np.size(one) for one in numbers_in.values()))
        messages.setdefault(topic, []).append((t_ns, numbers_in))
    messages = {topic: found for topic, found in messages.items() if found[0][1]}
    if not messages:
        raise DataDamaged(f"{path} has no messages with numbers")
    clock = max(messages, key=lambda topic: len(messages[topic]))
    for found in messages.values():
        found.sort(key=lambda one: one[0])
    since_ns = _since_first(path, messages, clock)
    t_s = np.array([t_ns for t_ns, _ in messages[clock]], dtype=np.float64) * 1e-9
    numbers: dict[str, Numbers] = {}
    for topic, found in messages.items():
        last = np.searchsorted(since_ns[topic], since_ns[clock], side="right") - 1
        for name, example in found[0][1].items():
            width = np.size(example)
            rows = [one.get(name, np.full(width, np.nan)) for _, one in found]
            if any(np.size(row) != width for row in rows):
                continue  # an array whose length changes has no fixed columns
            values = np.array(rows, dtype=np.float64).reshape(len(rows), -1)[np.maximum(last, 0)]
            values[last < 0] = np.nan
            numbers[name] = values[:, 0] if values.shape[1] == 1 else values
    return [ColumnTable(source=path.name, numbers=numbers, t_s=t_s)]


def _since_first(
    path: Path, messages: Mapping[str, Sequence[tuple[int, Any]]], clock: str
) -> dict[str, NDArray[np.int64]]:
    """Return the times of the messages (ns) since the first of this topic. Raises DataDamaged."""
    # From 2262 on, nanoseconds since 1970 do not fit into an int64; their differences do.
    began_ns = messages[clock][0][0]
    try:
        return {
            topic: np.array([t_ns - began_ns for t_ns, _ in found], dtype=np.int64)
            for topic, found in messages.items()
        }
    except OverflowError as error:
        raise DataDamaged(f"{path} has messages that are more than 292 years apart") from error


def _messages(path: Path, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time (ns) and message. The time is that of the header, or that of the recording if it has none."""
    if path.suffix == ".mcap":
        with readable(path):
            refuse_devices(path)
            yield from _mcap_messages(path, topics)
        return
    with opened_bag(path) as bag:
        yield from bag.messages(lambda topic: not topics or topic in topics)


def _mcap_messages(path: Path, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
    """Yield the messages of a single MCAP file, which rosbags reads only within the folder of a bag."""
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise PluginUnavailable(
            f'reading MCAP files of ROS needs rosbags: {error}\n  try: pip install "graspsense[ros]"'
        ) from error

    store = get_typestore(Stores.EMPTY)
    definitions = Definitions(path, store.fielddefs)
    schemas: dict[int, Schema] = {}
    channels: dict[int, tuple[str, str]] = {}
    for record in _mcap_records(path):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = schemas.get(record.schema_id)
            wanted = not topics or record.topic in topics
            if wanted and schema is not None and (schema.encoding, record.message_encoding) == _READ:
                if schema.name not in store.fielddefs:
                    store.register(get_types_from_msg(schema.data.decode(), schema.name))
                channels[record.id] = record.topic, schema.name
        elif isinstance(record, Message) and record.channel_id in channels:
            topic, name = channels[record.channel_id]
            definitions.check(name, len(record.data))
            value = store.deserialize_cdr(record.data, name)
            yield topic, stamp_ns(value) or record.log_time, value


def _mcap_records(path: Path) -> Iterator[McapRecord]:
    unpacked = Unpacked(path)
    with path.open("rb") as file:
        for record in records_of(file, unpacked):
            if isinstance(record, Chunk):
                yield from records_in(record, unpacked)
            else:
                yield record


def _numbers_in(value: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield the name and the value of each number, and of each array of numbers, in a message."""
    for field in getattr(value, "__dataclass_fields__", ()):
        if field.startswith("__"):
            continue
        inner, here = getattr(value, field), f"{name}.{field}"
        if isinstance(inner, bool | int | float):
            yield here, float(inner)
        elif (
            isinstance(inner, np.ndarray) and inner.dtype.kind in "fiub" and 0 < inner.size <= MOST_COMPONENTS
        ):
            yield here, inner.astype(np.float64)
        elif hasattr(inner, "__dataclass_fields__") and field != "header":
            yield from _numbers_in(inner, here)


def read_topics(path: Path) -> list[ColumnTable]:
    """Return a table for each topic with numbers in a bag or an MCAP file, with the times of its own messages.

    Raises as `read_bag`.
    """
    messages: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    kept = Unpacked(path)
    for topic, t_ns, message in _messages(path, ()):
        found = dict(_numbers_in(message, topic))
        kept.add(sum(_NUMBER_BYTES + 8 * np.size(one) for one in found.values()))
        if found:
            messages.setdefault(topic, []).append((t_ns, found))
    if not messages:
        raise DataDamaged(f"{path} has no messages with numbers")
    clock = max(messages, key=lambda topic: len(messages[topic]))
    since_ns = _since_first(path, messages, clock)
    tables = []
    for topic, rows in messages.items():
        order = np.argsort(since_ns[topic], kind="stable")
        numbers: dict[str, Numbers] = {}
        for name, example in rows[0][1].items():
            width = np.size(example)
            if all(np.size(one.get(name, ())) == width for _, one in rows):
                values = np.array([rows[k][1][name] for k in order], dtype=np.float64).reshape(len(rows), -1)
                numbers[name] = values[:, 0] if width == 1 else values
        t_s: Numbers = since_ns[topic][order].astype(np.float64) * 1e-9
        tables.append(ColumnTable(source=topic, numbers=numbers, t_s=t_s))
    return tables
