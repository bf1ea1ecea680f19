"""How much gas an opening lets through."""

from __future__ import annotations

import math
from typing import Final

AIR_KG_M3: Final = 1.2
DISCHARGE: Final = 0.6
"""Of a sharp-edged opening (any text on orifice meters)."""
LAMINAR_BELOW_PA: Final = 1.0
"""The flow through an opening is viscous below about a pascal."""


def conductance(opening_m2: float, rise_pa: float) -> float:
    """Return flow over pressure (m3/s/Pa) of an opening (m2, greater than 0) at this pressure across it.

    Viscous and inertial losses add up, p = R q + B q |q| with B = rho / (2 (C_d A)^2), and R is such that the
    two are alike at about `LAMINAR_BELOW_PA`: straight through zero, a square root far from it.
    """
    through = DISCHARGE * opening_m2
    inertial = 0.5 * AIR_KG_M3 / (through * through)
    viscous = 2.0 * math.sqrt(inertial * LAMINAR_BELOW_PA)
    return 2.0 / (viscous + math.sqrt(viscous * viscous + 4.0 * inertial * abs(rise_pa)))
