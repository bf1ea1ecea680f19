"""Heat maps of the tactile arrays of a grasp: every array at contact, at the peak and at rest."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise
from typing import Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.values.channel import FLOATS, Channel, TactileArray
from graspsense.core.values.trace import Floats, ImageTrace, Trace
from graspsense.core.values.units import display_unit, without_underscores
from graspsense.report.camera import GAP, TALLEST, camera_figure, is_picture
from graspsense.report.heat import COLOURS, HeatScale
from graspsense.report.html import figure
from graspsense.report.moments import array_images, images_at, moments
from graspsense.report.svg import QUIET, Picture, number

LARGEST_CELL: Final = 34.0
CELL_RIM: Final = 0.06
"""The part of a cell's width that stays free on each side."""


@frozen
class _Place:
    """The left upper corner of a cell and its side, in units of the map, whose width is 1."""

    x: float
    y: float
    side: float


@frozen
class _Layout:
    """Where each cell is drawn; `height` is that of the map where its width is 1."""

    cells: tuple[_Place, ...]
    columns: float
    height: float

    def placed(self, left: float, top: float, width: float) -> list[_Place]:
        """Return the cells of a map with this left upper corner and this width in a picture."""
        return [_Place(left + width * cell.x, top + width * cell.y, width * cell.side) for cell in self.cells]


def tactile_figures(trace: Trace, channels: Sequence[Channel]) -> list[str]:
    """Return one figure for each tactile array that delivered an image.

    A map shows the change of each cell since shortly before contact, in the unit of the array, or the values
    themselves where there is no image before contact. Both fingertips of `pads` share a figure. Large arrays and
    cameras are drawn as pictures instead.
    """
    declared = {channel.name: channel for channel in channels if isinstance(channel, TactileArray)}
    figures, pictures = [], []
    for name, sides in array_images(trace).items():
        (images, *_), shape = sides.values(), declared.get(name)
        if shape is None or images.cells.shape[1:] != shape.shape:
            shape = _as_delivered(name, trace.units.get(name, "unknown"), images)
        title = "fingertips" if name == "pads" else without_underscores(name)
        if is_picture(shape):
            pictures += [
                camera_figure(f"{side} fingertip" if side else title, images, shape, moments(trace))
                for side, images in sides.items()
            ]
        else:
            figures.append(_figure(title, sides, shape, moments(trace)))
    return [*figures, *pictures]


def _as_delivered(name: str, unit: str, images: ImageTrace) -> TactileArray:
    """Return an array that nobody has declared, as its images show it: floats in a row, other types by their shape."""
    dtype: Any = str(images.cells.dtype)
    sizes = images.cells.shape[1:]
    rows, columns, components = (1, *sizes, 1)[:3] if dtype == FLOATS or len(sizes) < 2 else (*sizes, 1)[:3]
    return TactileArray(name, unit, rows=rows, columns=columns, components=components, dtype=dtype)


def _figure(
    title: str, images: Mapping[str, ImageTrace], shape: TactileArray, times: Mapping[str, float]
) -> str:
    unit, factor = display_unit(shape.unit)
    shown = {side: images_at(image, factor, times) for side, image in images.items()}
    relative = all(is_change for _, is_change in shown.values())
    facing = list(shape.facing) or [True] * shape.cells
    scale = HeatScale.over(
        (
            float(value)
            for at_moments, _ in shown.values()
            for cells in at_moments.values()
            for value, faces in zip(cells, facing, strict=True)
            if faces
        ),
        unit,
    )
    layout = layout_of(shape)
    picture = Picture(0.0)
    picture.title(title)
    maps = max(len(times), 1)
    room = (picture.width - GAP * (maps - 1)) / maps
    width = min(room, layout.columns * LARGEST_CELL, TALLEST / layout.height)
    top = 44.0
    said = []
    for side, (at_moments, _) in shown.items():
        for k, (moment, cells) in enumerate(at_moments.items()):
            left = k * (room + GAP)
            words = f"{moment}, {side}" if side and len(shown) > 1 else moment
            picture.text(left, top - 6, words, ink=QUIET)
            _draw(picture, layout.placed(left, top, width), cells, scale, words)
            if np.isfinite(cells).any():
                said.append(f"{words} up to {number(float(np.nanmax(cells)))} {unit}")
        top += width * layout.height + 26.0
    scale.legend(picture, 0.0, top - 12.0, min(picture.width, 220.0))
    picture.height = top + 20.0
    what = (
        "Change of each cell since shortly before contact"
        if relative
        else "Values of each cell; no image is from before contact"
    )
    on = f" on the {shape.finger}" if shape.finger and len(shown) == 1 else ""
    facts = f"{title}{on}: {shape.cells} cells{' each' if len(shown) > 1 else ''}"
    words = f"Heat maps of {facts}. {what}: {'; '.join(said)}"
    caption = f"{facts[0].upper()}{facts[1:]}. {what}, in {unit}. Each map is the last image at that moment."
    if any(math.isnan(x) for place in shape.positions_m for x in place):
        caption += " Below the face are the cells that are elsewhere on the fingertip."
    return figure(picture.svg(words), caption)


def layout_of(shape: TactileArray) -> _Layout:
    """Return where each cell is drawn: by its position, the far end of the finger at the top, or by row and column."""
    if not shape.positions_m:
        side = 1.0 / shape.columns
        cells = [
            _Place(column * side, row * side, side)
            for row in range(shape.rows)
            for column in range(shape.columns)
        ]
        return _Layout(tuple(cells), float(shape.columns), shape.rows * side)
    placed = [(x, y) for x, y in shape.positions_m if math.isfinite(x) and math.isfinite(y)]
    if not placed:
        return layout_of(TactileArray(shape.name, shape.unit, rows=1, columns=shape.cells))
    pitch = _pitch(placed)
    left, far = min(y for _, y in placed), max(x for x, _ in placed)
    elsewhere = len(shape.positions_m) - len(placed)
    columns = max((max(y for _, y in placed) - left) / pitch + 1.0, float(min(elsewhere, 4)))
    face = (far - min(x for x, _ in placed)) / pitch + 1.0
    side = 1.0 / columns
    cells, outside = [], 0
    for x, y in shape.positions_m:
        if math.isfinite(x) and math.isfinite(y):
            cells.append(_Place((y - left) / pitch * side, (far - x) / pitch * side, side))
        else:
            row, column = divmod(outside, int(columns))
            cells.append(_Place(column * side, (face + 0.4 + row) * side, side))
            outside += 1
    rows = face + (0.4 + math.ceil(elsewhere / int(columns)) if elsewhere else 0.0)
    return _Layout(tuple(cells), columns, rows * side)


def _pitch(placed: Sequence[tuple[float, float]]) -> float:
    """Return the least distance of two cells along or across the finger; 1 of a single cell."""
    steps = [
        place_after - place_before
        for axis in (0, 1)
        for place_before, place_after in pairwise(sorted({round(place[axis], 7) for place in placed}))
    ]
    return min(steps, default=1.0)


def _draw(
    picture: Picture,
    places: Sequence[_Place],
    values: Floats,
    scale: HeatScale,
    words: str,
) -> None:
    for i, (place, value) in enumerate(zip(places, values.tolist(), strict=True)):
        level = scale.level(value)
        x, y, side = place.x, place.y, place.side
        rim = CELL_RIM * side
        fill = "none" if level < 0 else COLOURS[level]
        shown = "missing" if level < 0 else f"{number(value)} {scale.unit}"
        title = escape(f"{words}, cell {i}: {shown}")
        picture.parts.append(
            f'<rect x="{x + rim:.1f}" y="{y + rim:.1f}" width="{side - 2 * rim:.1f}" height="{side - 2 * rim:.1f}" '
            f'fill="{fill}" stroke="{QUIET}" stroke-width="0.5"><title>{title}</title></rect>'
        )
