"""The drives that the simulator can model, by the name that the setting `transmission` gives.

The numbers of the PR2 are published. The driver of the real gripper (graspsense-pr2-gripper, `linkage.py`) has the
same ones; `tests/sources/test_pr2_numbers.py` holds the two equal. The map from motor revolutions to the gap is
`pr2_mechanism_model/src/pr2_gripper_transmission.cpp`, here `graspsense.gripper_api.gap_and_rate`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from graspsense.gripper_api import ScrewLinkage, screw_linkage
from graspsense.simulator_api import straight_linkage

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

STRAIGHT: Final = straight_linkage(4e-4)
"""Jaws on a screw. One tick of the encoder is then a third of a micrometre of the gap, as with the PR2's linkage."""

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
    "straight": STRAIGHT,
}
"""Three published sets for the PR2, and a straight drive. The paper does not state which set its data are from."""

ENCODER_TICKS: Final = 1200
"""Encoder pulses in one revolution of the motor (pr2_ethercat_drivers, actuators.conf)."""
