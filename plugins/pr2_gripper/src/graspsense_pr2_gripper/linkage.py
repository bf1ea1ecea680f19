"""The linkage and the encoder of the PR2 gripper, and the scale of its pressure cells: published numbers.

The simulator (graspsense-sim-gripper, `drive_models.py` and `sensing.py`) has the same numbers as data of its model;
`tests/sources/test_pr2_numbers.py` holds the two equal. The map from motor revolutions to the gap is
`pr2_mechanism_model/src/pr2_gripper_transmission.cpp`, here `graspsense.gripper_api.gap_and_rate`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from graspsense.gripper_api import ScrewLinkage, screw_linkage

_ALPHA2 = {
    "theta0_deg": 2.97571,
    "phi0_deg": 29.98717,
    "t0_mm": -0.19543,
    "length0_mm": 34.70821,
    "h_mm": 5.200,
    "a_mm": 67.56801,
    "b_mm": 48.97193,
    "r_mm": 91.5,
}

LINKAGES: Final[Mapping[str, ScrewLinkage]] = {
    # pr2_common, pr2_description/robots/pr2.urdf.xacro: the gripper as it was delivered.
    "pr2": screw_linkage(
        screw_mm=4.0,
        gear=(729.0 / 25.0) * (22.0 / 16.0),
        theta0_deg=3.6029,
        phi0_deg=29.7089,
        t0_mm=-0.1914,
        length0_mm=37.5528,
        h_mm=0.0,
        a_mm=68.3698,
        b_mm=43.3849,
        r_mm=91.5,
    ),
    # Description of the whole robot of September 2009 (personalrobots-pkg), with the alpha2 linkage in code.
    "pr2_2009": screw_linkage(screw_mm=2.0, gear=29.16, **_ALPHA2),
    # The paper package's own launch file, sandbox/pr2_gripper_controller/launch/gripper.xml ("new gripper").
    "pr2_paper": screw_linkage(screw_mm=4.0, gear=29.16 * 22.0 / 16.0 * 0.9, **_ALPHA2),
}
"""Three published sets. The paper does not state which set its data are from."""

ENCODER_TICKS: Final = 1200
"""Encoder pulses in one revolution of the motor (pr2_ethercat_drivers, actuators.conf)."""

FRICTION_N: Final = 7.0
"""Coulomb friction that pr2_gripper_sensor feeds forward to its position servo, as effort (gripper_controller.h)."""

OPEN_GAP_M: Final = 0.086
"""Gap of the open fingers: `open_gap_m` of the simulator. The stroke is 0.09 m (gripper.urdf.xacro of pr2_common)."""

PAD_COUNTS_PER_N: Final = 1600
"""Counts of the sum of the fifteen cells of the gripping face under one newton (fingertip_pressure, scripts/
fingertip_geometry.py)."""
SIDE_COUNTS_PER_N: Final = 400
"""Counts of a side cell (1 and 6) under one newton; source as above."""
EDGE_COUNTS_PER_N: Final = 600
"""Counts of any other cell on an edge (0 and 2 to 5) under one newton; source as above."""


def edge_scale(side: float, edge: float) -> tuple[float, ...]:
    """Return the counts under one newton of the cells 0 to 6: back, side, corner, tip, tip, corner, side."""
    return (edge, side, edge, edge, edge, edge, side)
