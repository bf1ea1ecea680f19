"""A closed or vented volume of gas: the combinations of its numbers that squeezes determine.

A compression d displaces A d of the volume V of a gas at pressure p, whose exponent is n. Closed, it is a spring of
stiffness n p A^2 / V that stiffens towards the length V / A. Through a vent of area a, a steady speed v makes a force

    rho A^3 / (2 C_d^2 a^2) v^2,

so that stiffness and this resistance give how the force of a vented gas rises and relaxes (`terms.gas`, `terms.vent`).
No squeeze shows A, V, p, n and a one by one. The others are fixed at conventional values: the pressure of the
atmosphere, a gas at the temperature of its walls (n = 1), no bulge, and, behind a vent, an area of 10 cm2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

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


def without_combinations(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return the parameters of a gas with area, volume and vent in place of their combinations.

    With a length it is closed. Otherwise it is vented, and the area is among the parameters.
    """
    own = dict(parameters)
    stiffness = own.pop(STIFFNESS)
    if LENGTH in own:
        length = own.pop(LENGTH)
        own["area_m2"] = stiffness * length / (EXPONENT * PRESSURE_PA)
        own["volume_m3"] = own["area_m2"] * length
        return own
    area = own["area_m2"]
    own["volume_m3"] = EXPONENT * PRESSURE_PA * area * area / stiffness
    own["vent_m2"] = math.sqrt(0.5 * AIR_KG_M3 * area**3 / own.pop(RESISTANCE)) / DISCHARGE
    return own


def combinations(gas: Gas) -> dict[str, float]:
    """Return the combinations of the numbers of a gas without bulge."""
    combined = {STIFFNESS: gas.exponent * gas.pressure_pa * gas.area_m2**2 / gas.volume_m3}
    if gas.vent_m2 > 0.0:
        combined[RESISTANCE] = 0.5 * AIR_KG_M3 * gas.area_m2**3 / (DISCHARGE * gas.vent_m2) ** 2
    else:
        combined[LENGTH] = gas.volume_m3 / gas.area_m2
    return combined
