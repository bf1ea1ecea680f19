"""From raw cell counts to newtons: the tare, and the force on a fingertip.

Raw counts have an offset of some thousands that differs by cell, finger and run, so every force is a difference
from images taken with nothing touching. Counts per newton are those of the PR2 fingertip
(`fingertip_pressure/fingertip_geometry.py`); the viewer and this module divide by them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from graspsense.core.errors import TareRefused
from graspsense.core.signals import CELLS, FIRST_PAD_CELL, Pads

PAD_COUNTS_PER_N: Final = 1600.0
EDGE_COUNTS_PER_N: Final = (600.0, 400.0, 600.0, 600.0, 600.0, 600.0, 400.0)
"""Cells 0-6: back, side, corner, tip, tip, corner, side."""

TARE_SPREAD_N: Final = 0.5
"""A tare is refused where the pad sum varies by more than this while nothing should touch."""

Cells = tuple[float, ...]


def pad_force(cells: Cells, zero: Cells) -> float:
    """Return the force (N) on the fifteen cells of the gripping face, edges left out."""
    total = 0.0
    for i in range(FIRST_PAD_CELL, CELLS):
        total += cells[i] - zero[i]
    return total / PAD_COUNTS_PER_N


def edge_force(cells: Cells, zero: Cells) -> float:
    """Return the largest force (N) on a single edge cell (0-6)."""
    largest = (cells[0] - zero[0]) / EDGE_COUNTS_PER_N[0]
    for i in range(1, FIRST_PAD_CELL):
        force = (cells[i] - zero[i]) / EDGE_COUNTS_PER_N[i]
        if force > largest:
            largest = force
    return largest


def zero_of(images: Sequence[Cells]) -> Cells:
    """Return the mean of these images of one fingertip, cell by cell."""
    total = images[0]
    for image in images[1:]:
        total = tuple([a + b for a, b in zip(total, image, strict=True)])
    return tuple([cell / len(images) for cell in total])


def tare(images: Sequence[Pads]) -> tuple[Cells, Cells]:
    """Return the zero of the left and of the right fingertip from images taken with nothing touching.

    Raises TareRefused where there is no image, a value is no number, or a pad's sum varies by more than
    `TARE_SPREAD_N` over the images: something touches or moves.
    """
    if not images:
        raise TareRefused("no cell image came while taring: check the fingertips' cables, then try again")
    zeros: list[Cells] = []
    for side, cells in (("left", [i.left for i in images]), ("right", [i.right for i in images])):
        zero = zero_of(cells)
        if any(value != value for value in zero):
            raise TareRefused(f"the {side} fingertip gives cells that are no numbers, so it cannot be tared")
        forces = [pad_force(image, zero) for image in cells]
        spread = max(forces) - min(forces)
        if spread > TARE_SPREAD_N:
            raise TareRefused(
                f"the {side} pad varied by {spread:.2f} N while taring, and {TARE_SPREAD_N} N is allowed: "
                "take everything out of the gripper, wait until it is still, and try again"
            )
        zeros.append(zero)
    return zeros[0], zeros[1]
