"""ROS bags and MCAP files of ROS messages as tables, read by rosbags.

Every number in a message is a column, `/topic.field.field`; an array of numbers is a column with components. The rows
are the messages of the topic, among those that are used, that has the most; each other topic holds its last value, as
long as it is not too old (`topic_clocks`).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.records import Channel, Chunk, McapRecord, Message, Schema

from graspsense.core.values.errors import ConfigError, DataDamaged, PluginUnavailable
from graspsense.recording.mcap_records import records_in, records_of
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.formats.ros_bags import Definitions, opened_bag, stamp_ns
from graspsense.sources.formats.table import MOST_NAMES, ColumnTable, Numbers
from graspsense.sources.formats.topic_clocks import (
    Messages,
    Nanoseconds,
    TopicTimes,
    common_clock,
    on_one_clock,
)

MOST_COMPONENTS: Final = 4096
"""An array with more numbers is a picture, and is left out."""
_READ: Final = ("ros2msg", "cdr")
"""The encodings of a schema and of its messages that are read."""
_NUMBER_BYTES: Final = 100
"""Bytes of a single number of a message in memory, with its name, about."""
SAME: Final = 0.02
"""Share of the range of a value within which it is the same before and after a silence of its topic."""


def read_bag(path: Path, used: Collection[str] = ()) -> list[ColumnTable]:
    """Return the numbers in a ROS 1 bag, a folder of a ROS 2 bag, or an MCAP file.

    Of the columns that are `used`, the topics are read; with none, all. Raises PluginUnavailable without rosbags,
    ConfigError, DataDamaged.
    """
    if not path.exists():
        raise ConfigError(f"{path} cannot be read: there is no such file")
    values, times = _collected(path, used)
    clock = common_clock(path.name, times)
    longest = max(values, key=lambda topic: len(values[topic]))
    rows_ns = clock.topics[longest].between(clock.begin_ns, clock.end_ns)
    numbers: dict[str, Numbers] = {}
    for topic, value in values.items():
        numbers |= _held(clock.topics[topic], value, rows_ns)
    return [
        ColumnTable(
            source=path.name,
            numbers=numbers,
            t_s=np.array([clock.began_ns + ns for ns in rows_ns.tolist()], dtype=np.float64) * 1e-9,
            notes=clock.notes,
            warnings=clock.notices,
            delays_s={topic: ns * 1e-9 for topic, ns in clock.delays_ns.items()},
        )
    ]


def _collected(
    path: Path, used: Collection[str]
) -> tuple[dict[str, list[dict[str, Any]]], dict[str, Messages]]:
    """Return the numbers in the messages of each topic that has any, and when the messages came.

    A topic whose messages name different things is one topic for each, such as `/joint_states.finger`. Raises
    DataDamaged.
    """
    topics = {name.partition(".")[0] for name in used if re.match(r"/[^.*?]+\.", name)}
    came: dict[str, list[tuple[str, int, int, dict[str, Any]]]] = {}
    kept = Unpacked(path)
    for topic, recorded_ns, message in _messages(path, topics):
        numbers = dict(numbers_in(message, ""))
        kept.add(sum(_NUMBER_BYTES + 8 * np.size(column) for column in numbers.values()))
        # What its numbers are of, such as the names of joints.
        names = getattr(message, "name", "")
        names = names if isinstance(names, str) else "+".join(map(str, names))
        came.setdefault(topic, []).append((names, recorded_ns, stamp_ns(message), numbers))
    values: dict[str, list[dict[str, Any]]] = {}
    times: dict[str, Messages] = {}
    for topic, messages in came.items():
        # A driver can send a first message without names.
        divided = 1 < len({names for names, *_ in messages if names}) <= MOST_NAMES
        for names, recorded_ns, stamped_ns, numbers in messages:
            part = f"{topic}.{names}" if divided and names else topic
            if times.setdefault(part, Messages()).add(recorded_ns, stamped_ns, [*numbers.values()]):
                values.setdefault(part, []).append({f"{part}{k}": value for k, value in numbers.items()})
    values = {topic: value for topic, value in values.items() if value[0]}
    wanted = {topic for topic in values if any(name.startswith(f"{topic}.") for name in used)}
    # Of a topic that was divided, and named as a whole, the parts are shown.
    unknown = topics - {topic.partition(".")[0] for topic in wanted}
    wanted |= {topic for topic in values if topic.partition(".")[0] in unknown}
    values = {topic: value for topic, value in values.items() if topic in wanted or not wanted}
    if not values:
        raise DataDamaged(f"{path} has no messages with numbers")
    return values, {topic: times[topic] for topic in values}


def _held(times: TopicTimes, messages: Sequence[dict[str, Any]], rows_ns: Nanoseconds) -> dict[str, Numbers]:
    """Return the columns of a topic: in each row the last value, NaN where it is too old to hold.

    A value that is the same before and after a silence holds throughout.
    """
    last, old = times.latest(rows_ns)
    columns: dict[str, Numbers] = {}
    for name, every in _columns(times, messages):
        held = every[np.maximum(last, 0)]
        following = every[np.minimum(last + 1, len(every) - 1)]
        with np.errstate(all="ignore"):
            same = np.abs(following - held) <= SAME * np.ptp(every, axis=0)
        held[(old & (last + 1 < len(every)))[:, np.newaxis] & ~same] = np.nan
        columns[name] = held[:, 0] if held.shape[1] == 1 else held
    return columns


def _columns(times: TopicTimes, messages: Sequence[dict[str, Any]]) -> Iterator[tuple[str, Numbers]]:
    """Yield the numbers in the messages of a topic, as (messages, components); those whose length changes have none."""
    for name, example in messages[0].items():
        width = np.size(example)
        rows = [messages[k].get(name, np.full(width, np.nan)) for k in times.order]
        if all(np.size(row) == width for row in rows):
            yield name, np.array(rows, dtype=np.float64).reshape(len(rows), -1)


def _messages(path: Path, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time of recording (ns) and message."""
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
            yield topic, record.log_time, value


def _mcap_records(path: Path) -> Iterator[McapRecord]:
    unpacked = Unpacked(path)
    with path.open("rb") as file:
        for record in records_of(file, unpacked):
            yield from records_in(record, unpacked) if isinstance(record, Chunk) else (record,)


def numbers_in(value: Any, name: str) -> Iterator[tuple[str, Any]]:
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
            yield from numbers_in(inner, here)


def read_topics(path: Path) -> list[ColumnTable]:
    """Return a table for each topic with numbers in a bag or an MCAP file, with the times of its own messages.

    Raises as `read_bag`.
    """
    values, messages = _collected(path, ())
    _, times, notices = on_one_clock(path.name, messages)
    tables = []
    for topic, rows in values.items():
        columns = _columns(times[topic], rows)
        numbers = {name: every[:, 0] if every.shape[1] == 1 else every for name, every in columns}
        t_s: Numbers = times[topic].ns.astype(np.float64) * 1e-9
        tables.append(ColumnTable(source=topic, numbers=numbers, t_s=t_s, warnings=notices))
    return tables
