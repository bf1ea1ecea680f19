"""Pictures of large arrays and of cameras in a page: each at contact, at the peak and at rest, as a small PNG."""

from __future__ import annotations

import base64
import math
import struct
import zlib
from collections.abc import Mapping
from html import escape
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.channel import FLOATS, TactileArray
from graspsense.core.values.trace import ImageTrace
from graspsense.report.heat import GREYS, HeatScale
from graspsense.report.html import figure
from graspsense.report.moments import last_image
from graspsense.report.svg import QUIET, Picture, number

MOST_CELLS: Final = 1024
"""An array of more cells in rows and columns is drawn as a picture: a page has no room for a shape for each."""
LARGEST: Final = 112
"""Pixels of the longer side of a picture: the cells behind a pixel are averaged."""
GAP: Final = 14.0
"""Between two pictures or maps of an array."""
TALLEST: Final = 190.0
"""Limit on the height of a picture or map."""


def is_picture(shape: TactileArray) -> bool:
    """Return whether the images of an array are drawn as pictures."""
    grid = shape.rows * shape.columns
    return grid > MOST_CELLS or (grid > 0 and shape.dtype != FLOATS)


def camera_figure(title: str, images: ImageTrace, shape: TactileArray, times: Mapping[str, float]) -> str:
    """Return a figure with the image at each of these times (s), as far as there is one."""
    shown = {moment: last_image(images, t) for moment, t in times.items()}
    pictures = {
        moment: _smaller(cells.reshape(shape.rows, shape.columns, shape.components))
        for moment, cells in shown.items()
        if cells is not None
    }
    words = (
        f"{title}{f' on the {shape.finger}' if shape.finger else ''}: {shape.rows} x {shape.columns} cells"
    )
    if shape.components > 1:
        words += f" of {shape.components} numbers"
    scale = None
    # Colours and grey of a camera are shown as they are.
    if shape.dtype == "uint8" and shape.components != 2:
        caption = "As the camera saw them"
    else:
        pictures = {moment: _lengths(cells) for moment, cells in pictures.items()}
        scale = HeatScale.over(
            (value for cells in pictures.values() for value in cells.ravel().tolist()), shape.unit
        )
        span = scale.high - scale.low
        pictures = {moment: 255.0 * (cells - scale.low) / span for moment, cells in pictures.items()}
        caption = f"Black is {number(scale.low)}, white {number(scale.high)} {shape.unit}"
        caption += ", of the length of the numbers of a cell" if shape.components > 1 else ""
    picture = Picture(0.0)
    picture.title(title)
    room = (picture.width - GAP * (max(len(times), 1) - 1)) / max(len(times), 1)
    width = min(room, TALLEST * shape.columns / shape.rows)
    height = width * shape.rows / shape.columns
    for k, (moment, cells) in enumerate(pictures.items()):
        left = k * (room + GAP)
        picture.text(left, 38.0, moment, ink=QUIET)
        data = base64.b64encode(png(np.nan_to_num(np.rint(cells)).astype(np.uint8))).decode()
        picture.parts.append(
            f'<image x="{left:.1f}" y="44" width="{width:.1f}" height="{height:.1f}" '
            f'href="data:image/png;base64,{data}"><title>{escape(f"{title}, {moment}")}</title></image>'
        )
    picture.height = 44.0 + height + 4.0
    if scale is not None:
        scale.legend(picture, 0.0, picture.height + 6.0, 220.0, GREYS)
        picture.height += 36.0
    caption = f"{words[0].upper()}{words[1:]}. {caption}. Each picture is the last image at that moment, made smaller."
    return figure(picture.svg(f"Pictures of {words}, at {', '.join(pictures) or 'no moment'}"), caption)


def png(pixels: NDArray[np.uint8]) -> bytes:
    """Return a PNG file of pixels, shape (height, width, 1) in grey or (height, width, 3) in colours."""
    height, width, components = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)
    head = struct.pack(">IIBBBBB", width, height, 8, 2 if components == 3 else 0, 0, 0, 0)
    parts = ((b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in parts
    )


def _smaller(cells: NDArray[Any]) -> NDArray[np.float64]:
    """Return the means of square blocks of cells, so that no side is longer than `LARGEST`."""
    rows, columns, components = cells.shape
    side = math.ceil(max(rows, columns) / LARGEST)
    # The rim that fills no whole block is left out, unless there is no whole block.
    high, wide = min(side, rows), min(side, columns)
    whole = cells[: rows // high * high, : columns // wide * wide].astype(np.float64)
    blocks = whole.reshape(rows // high, high, columns // wide, wide, components)
    means: NDArray[np.float64] = blocks.mean(axis=(1, 3))
    return means


def _lengths(cells: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a number for each cell: the length of its components, or its only one."""
    return np.linalg.norm(cells, axis=2, keepdims=True) if cells.shape[2] > 1 else cells
