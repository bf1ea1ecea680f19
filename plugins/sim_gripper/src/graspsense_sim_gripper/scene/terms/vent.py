"""The flow of gas through an opening."""

from __future__ import annotations

import math
from typing import Final

AIR_KG_M3: Final = 1.2
DISCHARGE: Final = 0.6
"""Discharge coefficient of a sharp-edged opening (textbooks on orifice meters)."""
LAMINAR_BELOW_PA: Final = 1.0
"""Pressure below which the flow is mainly viscous: at most a fifth of the loss is inertial."""


def conductance(opening_m2: float, rise_pa: float) -> float:
    """Return the conductance (m3/s/Pa) of an opening (m2, positive): flow over pressure difference.

    Viscous and inertial losses add up: p = R q + B q |q| with B = rho / (2 (C_d A)^2). R is chosen so that both are
    equal at eight times `LAMINAR_BELOW_PA`. The flow is then linear near zero, and a square root of the pressure far
    from it.
    """
    viscous, inertial = _losses(opening_m2)
    return 2.0 / (viscous + math.sqrt(viscous * viscous + 4.0 * inertial * abs(rise_pa)))


def vented(opening_m2: float, driven_pa: float, spent_pa_s_m3: float) -> tuple[float, float]:
    """Return the pressure that remains with an opening, and the conductance at that pressure.

    The flow q reduces the pressure to p = `driven_pa` - `spent_pa_s_m3` q; with the losses above, q solves a quadratic.
    """
    viscous, inertial = _losses(opening_m2)
    linear = viscous + spent_pa_s_m3
    flow = 2.0 * driven_pa / (linear + math.sqrt(linear * linear + 4.0 * inertial * abs(driven_pa)))
    resistance = viscous + inertial * abs(flow)
    return resistance * flow, 1.0 / resistance


def _losses(opening_m2: float) -> tuple[float, float]:
    """Return R and B of an opening."""
    through = DISCHARGE * opening_m2
    inertial = 0.5 * AIR_KG_M3 / (through * through)
    return 2.0 * math.sqrt(inertial * LAMINAR_BELOW_PA), inertial
