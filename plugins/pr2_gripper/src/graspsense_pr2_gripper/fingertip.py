"""The pressure cells of a PR2 fingertip: 0 at the back, 1 to 6 along the edges, 7 to 21 on the gripping face.

The face has five rows of three cells, the row at the tip first. The distances of its cells are those that the simulated
gripper has, and are not measured. Where on the edges the other cells lie is not known.
"""

from __future__ import annotations

from math import nan
from typing import Final

from graspsense.plugin_api import TactileArray

CELLS: Final = 22
"""Number of cells of a fingertip."""
FIRST_PAD_CELL: Final = 7
"""The first cell on the gripping face."""
ROW_M: Final = 6.0e-3
COLUMN_M: Final = 5.6e-3
"""Distances between the centres of neighbouring cells of the face."""


def fingertips(rate_hz: float) -> TactileArray:
    """Return the channel of the cells of both fingertips, whose images come at this rate."""
    face = [(ROW_M * (2 - i // 3), COLUMN_M * (i % 3 - 1)) for i in range(CELLS - FIRST_PAD_CELL)]
    return TactileArray(
        "pads",
        "counts",
        rate_hz,
        positions_m=(*((nan, nan),) * FIRST_PAD_CELL, *face),
        facing=tuple(i >= FIRST_PAD_CELL for i in range(CELLS)),
    )
