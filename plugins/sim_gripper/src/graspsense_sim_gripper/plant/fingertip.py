"""The pressure cells of a simulated fingertip, those of the PR2: 0 at the back, 1 to 6 along the edges, then the face.

The face has five rows of three cells, the row at the tip first.
"""

from __future__ import annotations

from math import nan
from typing import Any, Final

from graspsense.plugin_api import TactileArray
from graspsense_sim_gripper.scene.instance import COLUMN_MM, PAD_CELLS, ROW_MM

FIRST_PAD_CELL: Final = 7
"""The first cell on the gripping face."""
CELLS: Final = FIRST_PAD_CELL + PAD_CELLS
"""Number of cells of a fingertip."""
CELL_OFFSET: Final = (3300.0, 250.0)
"""Mean and standard deviation of the counts of an unloaded cell; 2900 to 3800 counts are reported."""


def cell_offset(draw: Any) -> Any:
    """Return the counts of an unloaded cell with this standard normal draw, or of several with an array of them."""
    return CELL_OFFSET[0] + CELL_OFFSET[1] * draw


def fingertips(rate_hz: float) -> TactileArray:
    """Return the channel of the cells of both fingertips, whose images come at this rate."""
    face = [(1e-3 * ROW_MM * (2 - i // 3), 1e-3 * COLUMN_MM * (i % 3 - 1)) for i in range(PAD_CELLS)]
    return TactileArray(
        "pads",
        "counts",
        rate_hz,
        positions_m=(*((nan, nan),) * FIRST_PAD_CELL, *face),
        facing=tuple(i >= FIRST_PAD_CELL for i in range(CELLS)),
    )
