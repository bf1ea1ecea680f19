"""Where, how widely and how hard an object presses on a tactile array or on the pixels of a camera.

Let c(i, j) be the change of the cell in row i and column j since before the contact: of an array with one number a
cell, of that number; of one with three, of the last, which is the force into the surface; of a camera (whole numbers),
the magnitude of the change, as the mean of its colours. The image of the grasp is the one with the largest total from
the squeeze to the release. With w = max(c, 0) where that is at least `least_share` of the largest cell, and 0
elsewhere:

    total          sum of c
    area           share of the cells with w > 0
    centre         (m_i, m_j) = sum of w (i, j) / sum of w
    axes           square roots of the eigenvalues of S = sum of w (i - m_i, j - m_j)(i - m_i, j - m_j)' / sum of w
    angle          atan2(S_ij, S_jj - lambda_min), from the direction of the columns to that of the rows: the first axis
    shift          centre of the grasp less that of the first image with 25, 50 or 75 % of its total
    growth         axes of the grasp less those of the first image with this share
    shear          sums of the changes of the first and the second number of each cell, of an array with three

These are the moments of an image (M.-K. Hu, "Visual pattern recognition by moment invariants", IRE Transactions on
Information Theory 8 (1962) 179, section II). Rows and columns count from 0, and lengths are in cells.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import (
    HOLD,
    SQUEEZE,
    Channel,
    Feature,
    Features,
    FeatureSet,
    TactileArray,
    Trace,
    setting,
)

Floats = NDArray[np.float64]

FINGERTIPS: Final = "pads"
"""The array that stands for both fingertips."""
SIDES: Final = ("left_", "right_")
"""What the names of their features begin with."""
OF_ARRAY: Final = "unit of the array"
PERCENT: Final = (25, 50, 75)
"""Shares of the largest total from whose first image on the contact shifts and grows."""
_COURSE: Final = {
    "shift_row": "rows by which the centre moved",
    "shift_column": "columns by which it moved",
    "growth_long": "cells by which the first axis grew",
    "growth_short": "cells by which the second axis grew",
}
_PRESSED: Final = "a cell whose value rises"
_THREE: Final = "an array with three forces a cell"
QUANTITIES: Final = (
    ("total", OF_ARRAY, "sum of the changes of all cells", "an image before the squeeze and one in it"),
    ("largest", OF_ARRAY, "largest change of a cell", "an image before the squeeze and one in it"),
    ("area", "1", "share of the cells in contact", _PRESSED),
    ("centre_row", "1", "row of the centre, from 0", _PRESSED),
    ("centre_column", "1", "column of the centre, from 0", _PRESSED),
    ("long_axis", "1", "standard deviation along the first axis, in cells", _PRESSED),
    ("short_axis", "1", "standard deviation across it, in cells", _PRESSED),
    ("angle", "rad", "angle of the first axis from the direction of a row", "two axes that differ"),
    *(
        (f"{what}_{percent}", "1", f"{meaning} since {percent} % of the total", _PRESSED)
        for percent in PERCENT
        for what, meaning in _COURSE.items()
    ),
    ("shear_first", OF_ARRAY, "sum of the changes of the first force of each cell", _THREE),
    ("shear_second", OF_ARRAY, "sum of the changes of the second force", _THREE),
)
"""Name, unit, meaning and what it needs."""
FORCES: Final = 3
"""Number of components of a cell that measures shear."""
ROUND: Final = 1e-9
"""Two axes whose squares differ by less than this share have no direction."""


@frozen(kw_only=True)
class ContactImageConfig:
    """The array as the gripper declares it, and which cells count."""

    array: str = setting(
        default=FINGERTIPS,
        meaning="Name of the channel, or of several with commas between; pads: both fingertips. Of several, the name "
        "of each feature begins with that of its array.",
    )
    unit: str = setting(default="counts", meaning="Its unit.")
    rows: int = setting(default=7, minimum=1, meaning="Its rows.")
    columns: int = setting(default=4, minimum=1, meaning="Its columns.")
    components: int = setting(default=1, minimum=1, maximum=3, meaning="Its numbers a cell.")
    dtype: Literal["float64", "float32", "uint16", "uint8"] = setting(
        default="float64", meaning="The type of its numbers."
    )
    least_share: float = setting(
        default=0.1,
        above=0.0,
        maximum=1.0,
        meaning="Share of the largest change from which on a cell is in contact.",
    )


class Moments(NamedTuple):
    """The contact in one image."""

    area: float
    centre: tuple[float, float]
    axes: tuple[float, float]
    angle: float
    """NaN where both axes are equal."""


def moments(change: Floats, least_share: float) -> Moments | None:
    """Return the contact in an image of changes, shape (rows, columns); None if no cell is pressed."""
    largest = float(np.max(change))
    if not largest > 0.0:
        return None
    # Relative to the largest cell, so that no size of the numbers overflows.
    weights = np.where(change >= least_share * largest, np.maximum(change, 0.0) / largest, 0.0)
    places = np.indices(change.shape).reshape(2, -1).T.astype(np.float64)
    flat = weights.reshape(-1) / np.sum(weights)
    centre = flat @ places
    spread = (places - centre).T @ ((places - centre) * flat[:, np.newaxis])
    small, large = np.clip(np.linalg.eigvalsh(spread), 0.0, None).tolist()
    angle = math.nan
    if large - small > ROUND * max(large, 1.0):
        oblique = spread[0, 1] if abs(spread[0, 1]) > ROUND * large else 0.0
        along = spread[1, 1] - small if oblique else float(spread[1, 1] > spread[0, 0])
        angle = math.atan2(oblique or 1.0 - along, along)
    return Moments(
        area=float(np.mean(weights > 0.0)),
        centre=(float(centre[0]), float(centre[1])),
        axes=(math.sqrt(large), math.sqrt(small)),
        angle=angle,
    )


class ContactImages(NamedTuple):
    """The images of an array in a grasp, read one by one: those of a camera do not fit into memory as floats."""

    cells: NDArray[Any]
    unpressed: int
    """Number of images before the squeeze; 1 of a recording without phases, whose first image counts as that."""
    last: int
    """Number of images until the release."""
    shape: tuple[int, int, int]
    """(rows, columns, components) of an image; one row where the array has not as many cells as the settings say."""

    def zero(self) -> Floats:
        """Return the mean of the images before the squeeze."""
        total = np.zeros(self.shape)
        for i in range(self.unpressed):
            total += self._image(i)
        return total / self.unpressed

    def change(self, i: int, zero: Floats) -> Floats:
        """Return image `i` less `zero`, shape (rows, columns, components); a cell without a number did not change."""
        with np.errstate(all="ignore"):
            change = self._image(i) - zero
        change[~np.isfinite(change)] = 0.0
        return change

    def _image(self, i: int) -> Floats:
        return np.asarray(self.cells[i], dtype=np.float64).reshape(self.shape)


class ContactImageFeatures(FeatureSet[ContactImageConfig]):
    """Extracts area, centre, axes, total, shift and shear of the contact on an array, or on each of two fingertips."""

    @property
    def requires(self) -> tuple[Channel, ...]:  # type: ignore[override]
        """The array that the settings describe. Raises ValueError if no array can be like that."""
        own = self.config
        if own.array == FINGERTIPS:
            return (Channel(FINGERTIPS, own.unit),)
        rows, columns, components = own.rows, own.columns, own.components
        return tuple(
            TactileArray(name, own.unit, rows=rows, columns=columns, components=components, dtype=own.dtype)
            for name in self._arrays
        )

    @property
    def features(self) -> tuple[Feature, ...]:  # type: ignore[override]
        """The features, with the unit of the array where they have one."""
        return tuple(
            Feature(
                f"{side}{name}", self.config.unit if unit == OF_ARRAY else unit, f"{meaning}; needs {needs}"
            )
            for side in self._sides
            for name, unit, meaning, needs in QUANTITIES
        )

    def extract(self, trace: Trace) -> Features:
        """Return the features of the image with the largest total from the beginning of the squeeze to the release."""
        values: dict[str, float] = {}
        reasons: dict[str, str] = {}
        for side in self._sides:
            images = self._images(trace, side)
            known, why = ({}, images) if isinstance(images, str) else (self._measured(images), "")
            for name, *_ in QUANTITIES:
                if math.isfinite(known.get(name, math.nan)):
                    values[side + name] = known[name]
                else:
                    reasons[side + name] = why or self._why_missing(name, known)
        return self.result(values, reasons)

    @property
    def _arrays(self) -> tuple[str, ...]:
        return tuple(name.strip() for name in self.config.array.split(","))

    @property
    def _sides(self) -> tuple[str, ...]:
        """What the names of the features of each array, or fingertip, begin with."""
        if self.config.array == FINGERTIPS:
            return SIDES
        return tuple(f"{name}_" for name in self._arrays) if len(self._arrays) > 1 else ("",)

    @property
    def _is_camera(self) -> bool:
        return not self.config.dtype.startswith("float")

    @property
    def _has_shear(self) -> bool:
        return self.config.components == FORCES and not self._is_camera and self.config.array != FINGERTIPS

    def _images(self, trace: Trace, side: str) -> ContactImages | str:
        """Return the images from the squeeze to the release; the reason, where there is none to compare."""
        own, name = self.config, side.removesuffix("_") if len(self._arrays) > 1 else self.config.array
        if name == FINGERTIPS:
            t_s, cells, components = trace.pad_t_s, trace.pad_left, 1
            cells = cells if side == SIDES[0] else trace.pad_right
        elif (signal := trace.signals.get(name)) is None:
            return f"there is no array {name!r}"
        else:
            t_s, cells, components = signal.t_s, signal.cells, own.components
        grasping, squeezing = np.flatnonzero(trace.phase <= HOLD), np.flatnonzero(trace.phase >= SQUEEZE)
        last = int(np.searchsorted(t_s, trace.t_s[grasping[-1]], side="right")) if len(grasping) else 0
        unpressed = int(np.searchsorted(t_s, trace.t_s[squeezing[0]])) if len(squeezing) else 1
        unpressed = max(unpressed, 1)
        if last <= unpressed:
            return f"there is no image of {name!r} before the squeeze with one in it"
        numbers = cells[0].size
        if numbers % components:
            return f"an image of {name!r} has {numbers} numbers, and features.components is {components}"
        fits = numbers == own.rows * own.columns * components
        grid = (own.rows, own.columns) if fits else (1, numbers // components)
        return ContactImages(cells, unpressed, last, (*grid, components))

    def _measured(self, images: ContactImages) -> dict[str, float]:
        """Return the quantities that these images show."""
        zero, share = images.zero(), self.config.least_share
        squeezed = range(images.unpressed, images.last)
        totals = np.array([np.sum(self._pressed(images.change(i, zero))) for i in squeezed])
        peak = int(np.argmax(totals))
        change = images.change(images.unpressed + peak, zero)
        pressed = self._pressed(change)
        values = {"total": float(totals[peak]), "largest": float(np.max(pressed))}
        if self._has_shear:
            values["shear_first"], values["shear_second"], _ = np.sum(change, axis=(0, 1)).tolist()
        contact = moments(pressed, share)
        if contact is None:
            return values
        values["area"] = contact.area
        if pressed.shape == (self.config.rows, self.config.columns):
            values |= {
                "centre_row": contact.centre[0],
                "centre_column": contact.centre[1],
                "long_axis": contact.axes[0],
                "short_axis": contact.axes[1],
                "angle": contact.angle,
            }
            for percent in PERCENT:
                begun = images.unpressed + int(np.argmax(totals >= 0.01 * percent * totals[peak]))
                earlier = moments(self._pressed(images.change(begun, zero)), share)
                if earlier is not None:
                    now, then = (*contact.centre, *contact.axes), (*earlier.centre, *earlier.axes)
                    values |= {
                        f"{what}_{percent}": a - b for what, a, b in zip(_COURSE, now, then, strict=True)
                    }
        return values

    def _pressed(self, change: Floats) -> Floats:
        """Return how hard each cell is pressed, shape (rows, columns)."""
        pressed: Floats = np.mean(np.abs(change), axis=-1) if self._is_camera else change[..., -1]
        return pressed

    def _why_missing(self, name: str, known: Mapping[str, float]) -> str:
        if name.startswith("shear") and not self._has_shear:
            return "the array has no shear: that takes three forces a cell"
        if "area" not in known and name not in ("total", "largest"):
            return "no cell is pressed"
        if "centre_row" not in known:
            grid = f"{self.config.rows} x {self.config.columns}"
            return f"the array has not features.rows x features.columns = {grid} cells"
        if name.rpartition("_")[2].isdigit():
            return "no cell is pressed in its image with this share of the total"
        return "the contact is round" if name == "angle" else "its numbers are too large"
