"""What a recording holds: topics, fields and metadata of an MCAP file of ours, and the wire to its writer.

Messages are ROS 2 messages in CDR (schema encoding `ros2msg`, message encoding `cdr`), one scalar a field, every
field 8 bytes wide, so that a message is 4 bytes of CDR header and a packed structure. One topic holds the ticks,
another the cell images of the pads, on their own slower clock. An image stands before the tick that first had it.
"""

from __future__ import annotations

import struct
from typing import Final

from graspsense.core.signals import CELLS, Frame

VERSION: Final = 1
"""Of this layout; it stands in the metadata `graspsense` of every recording."""

PART: Final = ".part"
"""Behind the name of a recording that is not whole yet."""

TICK_TOPIC: Final = "/grasp/tick"
PADS_TOPIC: Final = "/grasp/pads"

_COMMAND_FIELDS: Final = ("command", "command_effort_limit_n", "command_speed_limit_m_s")
_INTEGERS: Final = frozenset({"status", "phase", "command_kind", "counter"})

TICK_FIELDS: Final = (*Frame._fields, "phase", "command_kind", *_COMMAND_FIELDS)
PADS_FIELDS: Final = (
    "t_s",
    "counter",
    *(f"left_{i:02d}" for i in range(CELLS)),
    *(f"right_{i:02d}" for i in range(CELLS)),
)

CDR_HEADER: Final = b"\x00\x01\x00\x00"
"""Little-endian CDR without options."""


def _schema(fields: tuple[str, ...]) -> bytes:
    kinds = ("int64" if name in _INTEGERS else "float64" for name in fields)
    return "".join(f"{kind} {name}\n" for kind, name in zip(kinds, fields, strict=True)).encode()


def _code(fields: tuple[str, ...]) -> str:
    return "".join("q" if name in _INTEGERS else "d" for name in fields)


SCHEMAS: Final = {
    TICK_TOPIC: ("graspsense_msgs/msg/Tick", _schema(TICK_FIELDS)),
    PADS_TOPIC: ("graspsense_msgs/msg/Pads", _schema(PADS_FIELDS)),
}
"""Topic to the name of its message and its definition."""

TICK: Final = struct.Struct("<" + _code(TICK_FIELDS))
PADS: Final = struct.Struct("<" + _code(PADS_FIELDS))

START: Final = "graspsense"
DEVICE: Final = "graspsense.device"
TRIAL: Final = "graspsense.trial"
"""Metadata records: what made the trial, which gripper it was, and, at the end, what came out. Each is a map of
texts; all but `version` are JSON or TOML."""

# To the writer's process: a byte that says what follows, then a body of fixed length, or of a length before it.
TICK_WIRE: Final = struct.Struct("<c" + _code(TICK_FIELDS))
PADS_WIRE: Final = struct.Struct("<c" + _code(PADS_FIELDS))
LENGTH_WIRE: Final = struct.Struct("<cI")
IS_TICK: Final = b"T"
IS_PADS: Final = b"P"
IS_METADATA: Final = b"M"
IS_END: Final = b"E"
"""The trial is over: end the file and give it its name."""
READY: Final = "ready\n"
"""What the writer's process says when the file is there; its last word is one line of JSON."""
