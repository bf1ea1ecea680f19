"""A copy of a recording with its tactile images as pictures, which Foxglove's Image panel shows.

A picture is a message `foxglove_msgs/msg/RawImage` (https://docs.foxglove.dev/docs/sdk/schemas/raw-image) in CDR. It
follows the message whose image it shows, on a topic of its own. Everything else is copied as it is, so that the copy
can be replayed like the recording.
"""

from __future__ import annotations

import io
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from attrs import define, frozen
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from graspsense import __version__
from graspsense.core.components.caller import option
from graspsense.core.values.channel import TactileArray
from graspsense.core.values.errors import ConfigError
from graspsense.recording.layout import CDR_HEADER, PADS_TOPIC, SIGNAL_TOPIC
from graspsense.recording.reader import largest_record
from graspsense.recording.recorded_grasp import RecordedGrasp

PICTURE_TOPIC: Final = "/grasp/pictures/"
"""Before the name of an array; the fingertips are `pads_left` and `pads_right`."""
CELL_PIXELS: Final = 16
"""Side of a cell in a picture: panels smooth a picture that they enlarge, so that smaller cells would run together."""
LARGE: Final = 16
"""Cells along a side from which on they are drawn smaller, so that a picture of a camera has a pixel for each."""
RAW_IMAGE: Final = "foxglove_msgs/msg/RawImage"
DEFINITION: Final = f"""builtin_interfaces/Time timestamp
string frame_id
uint32 width
uint32 height
string encoding
uint32 step
uint8[] data
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
NS: Final = 1_000_000_000


@frozen(eq=False)
class _Grid:
    """Where the cells of an array are in its picture: their numbers, rows and columns, and the side of a cell."""

    cells: NDArray[np.int64]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]

    def picture(self, brightness: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the picture, given the brightness of every cell, shape (cells,), or its colour, shape (cells, 3)."""
        height, width = int(self.rows.max()) + 1, int(self.columns.max()) + 1
        small = np.zeros((height, width, *brightness.shape[1:]), np.uint8)
        small[self.rows, self.columns] = brightness[self.cells]
        side = max(CELL_PIXELS // (1 + max(height, width) // LARGE), 1)
        return small.repeat(side, axis=0).repeat(side, axis=1)


@define(eq=False)
class _Pictures:
    """The pictures of one array: their topic, and the brightness of the cells in each image."""

    topic: str
    frame_id: str
    grid: _Grid
    images: Iterator[NDArray[np.uint8]]
    channel: int = 0
    number: int = 0


def with_pictures(grasp: RecordedGrasp) -> bytes:
    """Return the recording of this grasp with a picture after each tactile image.

    A cell is black at its value in the first image and white at the largest rise of any cell of the array (of both
    fingertips together), of several components at their largest change; cells without a position are left out. Grey
    and coloured images of a camera (`uint8`) are shown as they are. Raises ConfigError if there is no tactile image.
    """
    of_topic = _pictures(grasp)
    if not of_topic:
        raise ConfigError(f"{grasp.path} has no tactile images: export it without {option('pictures')}")
    out = io.BytesIO()
    writer = Writer(out, compression=CompressionType.ZSTD, enable_data_crcs=True)
    writer.start(profile="ros2", library=f"graspsense {__version__}")
    schemas: dict[int, int] = {}
    channels: dict[int, tuple[int, str]] = {}
    raw_image = writer.register_schema(RAW_IMAGE, "ros2msg", DEFINITION.encode())
    with grasp.path.open("rb") as file:
        for record in StreamReader(file, validate_crcs=True, record_size_limit=largest_record()).records:
            if isinstance(record, Metadata):
                writer.add_metadata(record.name, dict(record.metadata))
            elif isinstance(record, Schema) and record.id not in schemas:
                schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
            elif isinstance(record, Channel) and record.id not in channels:
                schema = schemas[record.schema_id]
                number = writer.register_channel(record.topic, record.message_encoding, schema)
                channels[record.id] = number, record.topic
                for pictures in of_topic.get(record.topic, ()):
                    pictures.channel = writer.register_channel(pictures.topic, "cdr", raw_image)
            elif isinstance(record, Message):
                number, topic = channels[record.channel_id]
                log_time = record.log_time
                writer.add_message(number, log_time, record.data, record.publish_time, record.sequence)
                for pictures in of_topic.get(topic, ()):
                    picture = pictures.grid.picture(next(pictures.images))
                    data = raw_image_message(log_time, pictures.frame_id, picture)
                    writer.add_message(pictures.channel, log_time, data, log_time, pictures.number)
                    pictures.number += 1
    writer.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()


def raw_image_message(time_ns: int, frame_id: str, picture: NDArray[np.uint8]) -> bytes:
    """Return a RawImage in CDR, given its pixels: (height, width) of grey, (height, width, 3) of colours."""
    height, width = picture.shape[:2]
    encoding, step = ("rgb8", 3 * width) if picture.ndim == 3 else ("mono8", width)
    # The format ends in 2038; a viewer places the message by its own time, which does not.
    body = struct.pack("<iI", min(time_ns // NS, 2**31 - 1), time_ns % NS) + _text(frame_id)
    body += struct.pack("<II", width, height) + _text(encoding)
    return CDR_HEADER + body + struct.pack("<II", step, picture.size) + picture.tobytes()


def _text(value: str) -> bytes:
    """Return a string in CDR, followed by what aligns the next number of 4 bytes."""
    data = value.encode() + b"\0"
    return struct.pack("<I", len(data)) + data + bytes(-len(data) % 4)


def _pictures(grasp: RecordedGrasp) -> Mapping[str, Sequence[_Pictures]]:
    """Return what is to be drawn of each topic with tactile images."""
    declared = {channel.name: channel for channel in grasp.channels if isinstance(channel, TactileArray)}
    drawn: dict[str, Sequence[_Pictures]] = {}
    for name, topic in grasp.topics.items():
        fields = topic.rows.dtype.names or ()
        if name == PADS_TOPIC:
            values = np.array([topic.numbers(i)[2:] for i in range(len(topic.rows))], dtype=float)
            cells = values.shape[1] // 2
            array = declared.get("pads")
            if array is None or array.cells != cells:
                array = TactileArray("pads", "unknown", rows=1, columns=cells)
            left, right = np.split(np.array([*_brightness(values[:, :, np.newaxis])]), 2, axis=1)
            grid = _grid_of(array)
            drawn[name] = (
                _Pictures(f"{PICTURE_TOPIC}pads_left", "left", grid, iter(left)),
                _Pictures(f"{PICTURE_TOPIC}pads_right", "right", grid, iter(right)),
            )
        elif name.startswith(SIGNAL_TOPIC) and "cells" in fields:
            array = declared[name.removeprefix(SIGNAL_TOPIC)]
            cells = topic.rows["cells"].reshape(len(topic.rows), array.cells, array.components)
            images = iter(cells.squeeze(axis=2) if array.components == 1 else cells)
            if array.dtype != "uint8" or array.components == 2:
                images = _brightness(cells)
            picture = _Pictures(
                PICTURE_TOPIC + array.name, array.finger or array.name, _grid_of(array), images
            )
            drawn[name] = (picture,)
    return drawn


def _brightness(cells: NDArray[Any]) -> Iterator[NDArray[np.uint8]]:
    """Yield the brightness of each cell in each image, shape (images, cells, components), one image after the other."""

    def rise(image: NDArray[Any]) -> NDArray[np.float64]:
        change = np.nan_to_num(image - cells[0].astype(float), nan=0.0, posinf=0.0, neginf=0.0)
        numbers: NDArray[np.float64] = (
            change[:, 0] if change.shape[1] == 1 else np.linalg.norm(change, axis=1)
        )
        return numbers

    most = max(float(rise(image).max()) for image in cells)
    scale = 255.0 / most if most > 0.0 else 0.0
    for image in cells:
        yield np.clip(np.rint(rise(image) * scale), 0, 255).astype(np.uint8)


def _grid_of(array: TactileArray) -> _Grid:
    """Return where the cells are drawn: by row and column, or by position with the far end of the finger at the top."""
    numbers = np.arange(array.cells)
    if array.rows * array.columns:
        return _Grid(numbers, numbers // array.columns, numbers % array.columns)
    placed = [i for i, place in enumerate(array.positions_m) if not any(map(math.isnan, place))]
    if not placed:
        return _Grid(numbers, np.zeros_like(numbers), numbers)
    along, across = np.array([array.positions_m[i] for i in placed]).T
    rows = np.unique(-along, return_inverse=True)[1]
    return _Grid(np.array(placed), rows, np.unique(across, return_inverse=True)[1])
