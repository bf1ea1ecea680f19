"""A closed or vented volume of gas: the combinations of its numbers that squeezes determine.

A compression d displaces A d of the volume V of a gas at pressure p, whose exponent is n. Closed, it is a spring of
stiffness n p A^2 / V that stiffens towards the length V / A. Through a vent of area a, a steady speed v makes a force

    rho A^3 / (2 C_d^2 a^2) v^2,

so that stiffness and this resistance give how the force of a vented gas rises and relaxes (`terms.gas`, `terms.vent`).
No squeeze shows A, V, p, n and a one by one. The others are fixed at conventional values: the pressure of the
atmosphere, a gas at the temperature of its walls (n = 1), no bulge, and, behind a vent, an area of 10 cm2.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from graspsense_sim_gripper.run.identification import AIR_KG_M3, DISCHARGE, Gas

PRESSURE_PA: Final = 101325.0
EXPONENT: Final = 1.0
AREA_M2: Final = 1e-3
"""Of a vented gas, whose volume is hardly compressed, so that its length does not show."""
AREA_FACTOR: Final = 2.0
"""By this factor the area may differ from the conventional one; what that changes is part of the intervals."""
FIXED: Final[Mapping[str, float]] = {
    "area_slope_m": 0.0,
    "pressure_pa": PRESSURE_PA,
    "exponent": EXPONENT,
    "bulge_m3_pa": 0.0,
}
"""What is fixed in every case."""
STIFFNESS: Final = "stiffness_n_m"
LENGTH: Final = "length_m"
RESISTANCE: Final = "resistance_n_s2_m2"


def parameters_of(combined: Mapping[str, Any], area_m2: float) -> dict[str, Any]:
    """Return area, volume and vent of a gas with these combinations, numbers or arrays.

    With a length it is closed, otherwise vented, with the area `area_m2`.
    """
    stiffness = combined[STIFFNESS]
    if LENGTH in combined:
        area = stiffness * combined[LENGTH] / (EXPONENT * PRESSURE_PA)
        return {"area_m2": area, "volume_m3": area * combined[LENGTH]}
    volume = EXPONENT * PRESSURE_PA * area_m2 * area_m2 / stiffness
    vent = np.sqrt(0.5 * AIR_KG_M3 * area_m2**3 / combined[RESISTANCE]) / DISCHARGE
    return {"volume_m3": volume, "vent_m2": vent}


def combinations(gas: Gas) -> dict[str, float]:
    """Return the combinations of the numbers of a gas without bulge."""
    combined = {STIFFNESS: gas.exponent * gas.pressure_pa * gas.area_m2**2 / gas.volume_m3}
    if gas.vent_m2 > 0.0:
        combined[RESISTANCE] = 0.5 * AIR_KG_M3 * gas.area_m2**3 / (DISCHARGE * gas.vent_m2) ** 2
    else:
        combined[LENGTH] = gas.volume_m3 / gas.area_m2
    return combined
