"""The layout of a recording: topics, fields and metadata of its MCAP file, and the protocol to the writer process.

Messages are ROS 2 messages in CDR (schema encoding `ros2msg`, message encoding `cdr`). Every field is a scalar of 8
bytes, so a message is 4 bytes of CDR header and a packed structure. One topic holds the control ticks. Another holds
the pad images, which come at their own, lower rate. An image precedes the first tick that used it.
"""

from __future__ import annotations

import struct
from typing import Final

from graspsense.core.signals import CELLS, Frame

VERSION: Final = 2
"""Version of this layout, stored in the metadata record `START` of every recording."""

PART: Final = ".part"
"""Suffix of a recording that is not complete yet."""

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
"""Topic to the name of its message type and the definition of that type."""

TICK: Final = struct.Struct("<" + _code(TICK_FIELDS))
PADS: Final = struct.Struct("<" + _code(PADS_FIELDS))

START: Final = "graspsense"
DEVICE: Final = "graspsense.device"
RESULT: Final = "graspsense.result"
"""Names of the metadata records, the sections of a `TrialRecord`: how the trial was made, which gripper made it, and
its result. Each is a map of texts. `settings` is TOML; the others are plain texts or JSON."""

# Protocol to the writer process: one byte for the kind of message, then a body. Ticks and images have a fixed length;
# metadata states its length first.
TICK_WIRE: Final = struct.Struct("<c" + _code(TICK_FIELDS))
PADS_WIRE: Final = struct.Struct("<c" + _code(PADS_FIELDS))
LENGTH_WIRE: Final = struct.Struct("<cI")
IS_TICK: Final = b"T"
IS_PADS: Final = b"P"
IS_METADATA: Final = b"M"
IS_END: Final = b"E"
"""The trial is over: finish the file and give it its final name."""
READY: Final = "ready\n"
"""Line that the writer process prints once the file exists. Its last line is a JSON object."""
