"""The layout of a recording: topics, fields, times and metadata of its file, and the protocol to the writer process.

Messages are ROS 2 messages in CDR (schema encoding `ros2msg`, message encoding `cdr`). Every field is a number of 8
bytes or a fixed number of them, and the last one may be a fixed number of smaller ones, the pixels of a camera; so a
message is 4 bytes of CDR header and a packed structure. The chunks of the file are compressed with zstd. One topic
holds the control ticks. Another holds the images of the fingertips, which come at their own, lower rate. Each tactile
array and each fast channel has a topic of its own, and one topic has the other channels. A message precedes the first
tick that used it. A topic but that of the ticks exists if it has a message.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable
from itertools import chain
from typing import Any, Final

from attrs import field, frozen

from graspsense.core.components.channels import dtype_of, shape_of
from graspsense.core.values.channel import FLOATS, TactileArray
from graspsense.core.values.limits import CHANNEL_NUMBERS
from graspsense.core.values.signals import Frame, Image, Reading, Samples

VERSION: Final = 2
"""Version of this layout, stored in the metadata record `START` of every recording."""

PART: Final = ".part"
"""Suffix of a recording that is not complete yet."""

TICK_TOPIC: Final = "/grasp/tick"
PADS_TOPIC: Final = "/grasp/pads"

_COMMAND_FIELDS: Final = ("command", "command_effort_limit_n", "command_speed_limit_m_s")
_INTEGERS: Final = frozenset({"status", "phase", "command_kind", "counter"})

TICK_FIELDS: Final = (*Frame._fields, "phase", "command_kind", *_COMMAND_FIELDS)
SCALARS_TOPIC: Final = "/grasp/scalars"
SIGNAL_TOPIC: Final = "/grasp/signals/"
"""Before the name of a tactile array or a fast channel."""
_BESIDE_A_CHANNEL: Final = 8
"""Numbers of a message beside those of a channel, at most."""

CDR_HEADER: Final = b"\x00\x01\x00\x00"
"""Little-endian CDR without options."""


def _schema(fields: tuple[str, ...]) -> bytes:
    kinds = ("int64" if name in _INTEGERS else "float64" for name in fields)
    return "".join(f"{kind} {name}\n" for kind, name in zip(kinds, fields, strict=True)).encode()


@frozen
class Topic:
    """A topic: its name, the name of its message type, the definition of the type.

    Every type begins with `t_s`. Its other fields are float64 or int64, alone or a fixed number of them; the last one
    may be a fixed number of uint8, uint16 or float32. Raises ValueError for any other definition.
    """

    name: str
    type_name: str
    definition: str
    fields: tuple[tuple[str, str, int], ...] = field(init=False)
    """Name, kind (a key of `KINDS`) and number of values of each field; 0 stands for a field that is no array."""

    @fields.default
    def _fields(self) -> tuple[tuple[str, str, int], ...]:
        fields = []
        for line in self.definition.splitlines():
            match = _FIELD.fullmatch(line)
            if match is None:
                raise ValueError(f"{self.name} has the field {line[:40]!r}")
            kind, number, name = match.groups()
            fields.append((name, _KIND_OF[kind], int(number or 0)))
        # The images of the fingertips have the numbers of a channel twice.
        most = 2 * CHANNEL_NUMBERS.most + _BESIDE_A_CHANNEL
        aligned = all(kind in "dq" for _, kind, _ in fields[:-1]) and (fields[-1][1] in "dq" or fields[-1][2])
        if fields[:1] != [("t_s", "d", 0)] or not aligned or sum(max(n, 1) for _, _, n in fields) > most:
            raise ValueError(f"{self.name} has other fields than graspsense writes")
        return tuple(fields)

    wire: struct.Struct = field(init=False, eq=False)
    """The structure of a message; an array of small numbers is packed as its bytes."""

    @wire.default
    def _wire(self) -> struct.Struct:
        return struct.Struct("<" + "".join(_packed(kind, number) for _, kind, number in self.fields))


def _packed(kind: str, number: int) -> str:
    return f"{max(number, 1)}{kind}" if kind in "dq" else f"{number * struct.calcsize('<' + kind)}s"


KINDS: Final = {"d": "float64", "q": "int64", "f": "float32", "H": "uint16", "B": "uint8"}
"""The types of the numbers of a field, by their code in a packed structure."""
_KIND_OF: Final = {name: kind for kind, name in KINDS.items()}
_FIELD: Final = re.compile(rf"({'|'.join(_KIND_OF)})(?:\[([1-9][0-9]{{0,17}})\])? ([a-z][a-z0-9_]*)")


TICKS: Final = Topic(TICK_TOPIC, "graspsense_msgs/msg/Tick", _schema(TICK_FIELDS).decode())
"""The topic of the ticks."""
TICK: Final = TICKS.wire
TICK_SCHEMA: Final = (TICKS.type_name, TICKS.definition.encode())


def pads_topic(cells: int) -> Topic:
    """Return the topic of the images of two fingertips with so many cells each."""
    if cells in (0, _FIRST_SIZE):
        return pads_topic_by_cell(cells)
    # A schema is one definition, so fingertips of another size have a name of their own.
    definition = f"float64 t_s\nint64 counter\nfloat64[{cells}] left\nfloat64[{cells}] right\n"
    return Topic(PADS_TOPIC, f"graspsense_msgs/msg/Pads{cells}", definition)


def pads_topic_by_cell(cells: int) -> Topic:
    """Return the topic with a field for each cell: of fingertips with 22 cells, and in old recordings of all."""
    sides = [f"{side}_{i:02d}" for side in ("left", "right") for i in range(cells)]
    name = "Pads" if cells == _FIRST_SIZE else f"Pads{cells}"
    return Topic(PADS_TOPIC, f"graspsense_msgs/msg/{name}", _schema(("t_s", "counter", *sides)).decode())


_FIRST_SIZE: Final = 22
"""Cells of the fingertips of the message type that has no number in its name."""


def signal_topics(signals: Any) -> list[tuple[Topic, Callable[[Reading], tuple[Any, ...] | None]]]:
    """Return the topics of the values of `Reading.signals`, each with what gives the numbers of its message.

    The function returns None where the reading has nothing new.
    """
    topics: list[tuple[Topic, Callable[[Reading], tuple[Any, ...] | None]]] = []
    scalars = []
    for i, name in enumerate(getattr(signals, "_fields", ())):
        value = signals[i]
        if isinstance(value, Image):
            topics.append((image_topic(name, value), _image_source(i, value)))
        elif isinstance(value, Samples):
            topics.append((samples_topic(name, len(value.values), len(value.values[0])), _samples_source(i)))
        else:
            scalars.append((i, name))
    if scalars:
        numbers = tuple(i for i, _ in scalars)
        definition = "float64 t_s\n" + "".join(f"float64 {name}\n" for _, name in scalars)
        topic = Topic(SCALARS_TOPIC, "graspsense_msgs/msg/Scalars", definition)
        topics.append((topic, lambda reading: (reading.frame.t_s, *[reading.signals[i] for i in numbers])))
    return topics


def image_topic(name: str, image: Image) -> Topic:
    """Return the topic of a tactile array, given an image of it. The name of its type has the shape."""
    shape, dtype = shape_of(image), dtype_of(image)
    definition = f"float64 t_s\nint64 counter\n{dtype}[{math.prod(shape)}] cells\n"
    kind = "" if dtype == FLOATS else dtype.capitalize()
    type_name = f"graspsense_msgs/msg/{kind}Array{'x'.join(map(str, shape))}"
    return Topic(SIGNAL_TOPIC + name, type_name, definition)


def shown_array(topic: Topic) -> TactileArray:
    """Return the tactile array of a topic as its messages show it: the type and the shape of its images.

    Raises ValueError for a shape that no array has.
    """
    name, (_, kind, numbers) = topic.name[len(SIGNAL_TOPIC) :], topic.fields[-1]
    dtype: Any = KINDS[kind]
    match = _SHAPE.search(topic.type_name)
    shape = tuple(map(int, match[1].split("x"))) if match else ()
    if math.prod(shape) != numbers:
        shape = (numbers,)
    if dtype == FLOATS:
        components = math.prod(shape[1:])
        return TactileArray(name, "unknown", rows=1, columns=shape[0], components=components)
    if len(shape) == 1:
        return TactileArray(name, "unknown", positions_m=((math.nan, math.nan),) * numbers, dtype=dtype)
    rows, columns, components = shape if len(shape) > 2 else (*shape, 1)
    return TactileArray(name, "unknown", rows=rows, columns=columns, components=components, dtype=dtype)


_SHAPE: Final = re.compile(r"Array([1-9][0-9]{0,9}(?:x[1-9][0-9]{0,9}){0,2})$")


def samples_topic(name: str, samples: int, axes: int) -> Topic:
    """Return the topic of a fast channel."""
    definition = f"float64 t_s\nint64 counter\nint64 new\nint64 axes\nfloat64[{samples * axes}] values\n"
    return Topic(SIGNAL_TOPIC + name, f"graspsense_msgs/msg/Samples{samples}x{axes}", definition)


def _image_source(i: int, example: Image) -> Callable[[Reading], tuple[Any, ...] | None]:
    last, dtype, several = 0, dtype_of(example), len(shape_of(example)) > 1

    def numbers(reading: Reading) -> tuple[Any, ...] | None:
        nonlocal last
        t_s, counter, cells = reading.signals[i]
        if counter == last:
            return None
        last = counter
        if dtype != FLOATS:
            return (t_s, counter, cells.tobytes())
        return (t_s, counter, *(chain.from_iterable(cells) if several else cells))

    return numbers


def _samples_source(i: int) -> Callable[[Reading], tuple[Any, ...] | None]:
    def numbers(reading: Reading) -> tuple[Any, ...] | None:
        t_s, counter, new, values = reading.signals[i]
        if not new:
            return None
        return (t_s, counter, new, len(values[0]), *chain.from_iterable(values))

    return numbers


START: Final = "graspsense"
DEVICE: Final = "graspsense.device"
RESULT: Final = "graspsense.result"
"""Names of the metadata records, the sections of a `TrialRecord`: how the trial was made, which gripper made it, and
its result. Each is a map of texts. `settings` is TOML; the others are plain texts or JSON."""
EVENT: Final = "graspsense.event."
"""Name of the metadata record of an event of the controller, before its number, which counts from 1. The record is
written when the event happens, so that a grasp that is cut off keeps its events; the result lists them once more. It is
a map of texts: `event` is JSON."""

HEAD_WIRE: Final = struct.Struct("<cIH")
"""The head of a message to the writer process: its kind, the length of its body, the number of its topic, or 0.

Topics are numbered in the order in which they were announced."""
TICK_WIRE: Final = struct.Struct(HEAD_WIRE.format + TICK.format.removeprefix("<"))
"""The head and the body of a tick."""
IS_TICK: Final = b"T"
IS_SIGNAL: Final = b"S"
IS_TOPIC: Final = b"A"
"""Announces a topic: its name, the name of its type and the definition, as JSON."""
IS_METADATA: Final = b"M"
IS_END: Final = b"E"
"""The trial is over: finish the file and give it its final name."""
READY: Final = "ready\n"
"""Line that the writer process prints once the file exists. Its last line is a JSON object."""


_LAST_NS: Final = 2**64 - 1
"""The last time that a message can have, in the year 2554."""


class LogClock:
    """Gives the gripper's time plus `base_ns`, the wall-clock time in nanoseconds at time 0 of the gripper's clock.

    If `base_ns` is None, it is taken from the first message.
    """

    def __init__(self, base_ns: int | None = None) -> None:
        self._base_ns = base_ns

    def log_ns(self, t_s: float, now_ns: int) -> int:
        """Return the time to log a message at that is of the gripper's time `t_s` and has come at `now_ns`."""
        if self._base_ns is None:
            self._base_ns = now_ns - nanoseconds(t_s)
        return min(max(0, self._base_ns + nanoseconds(t_s)), _LAST_NS)


def nanoseconds(t_s: float) -> int:
    """Return a time (s) in nanoseconds; 0 for one that no clock of a gripper gives."""
    return round(t_s * 1e9) if abs(t_s) < 1e9 else 0
