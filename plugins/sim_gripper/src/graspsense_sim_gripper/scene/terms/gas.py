"""Gas trapped in a container, which may leak and may exchange heat with its walls."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.scene.terms.phi import phi1, phi_ramp
from graspsense_sim_gripper.scene.terms.term import Rate, Term, WorkingPoint
from graspsense_sim_gripper.scene.terms.vent import conductance, vented

LEAST_M3: Final = 1e-9
"""Smallest volume of the gas: a microlitre, which keeps the divisions finite."""


class Gas(NamedTuple):
    """Gas behind a compliant wall.

    A compression d displaces the volume A0 d + A1 d^2 / 2 (`area_m2`, `area_slope_m`), and a pressure rise bulges the
    wall outwards by `bulge_m3_pa` per pascal. `exponent` is the polytropic exponent: 1 if the gas keeps the temperature
    of its walls during a grasp (a small head space), 1.4 if no heat is exchanged. With `heat_s` it changes from the
    adiabatic to the isothermal value within that time. `pressure_pa` is the absolute pressure before the grasp; the
    wall carries it, so that it exerts no force and drives no flow through the vent.
    """

    area_m2: float
    area_slope_m: float
    volume_m3: float
    pressure_pa: float
    exponent: float
    bulge_m3_pa: float
    vent_m2: float = 0.0
    """Area of an opening, from a pinhole to an open neck; 0 for a sealed container. The flow is viscous below about
    1 Pa, and that of an orifice above."""
    heat_s: float = math.inf
    """Time constant of the heat exchange with the walls."""


class GasState(NamedTuple):
    """Pressure above that at rest (Pa), and temperature above that of the walls as a fraction of it."""

    rise_pa: float
    warmth: float = 0.0
    spent: int = 0
    """1: the grasp displaced more than the volume of the gas; from then on only the wall and the vent yielded."""


def gas(params: Gas, state: GasState, d0: float, d1: float, h: float, v1: float) -> tuple[float, GasState]:
    """Return the force of the pressure rise, by an exponential midpoint step of second order.

    An ideal gas exchanges heat with walls of constant temperature:

        p' = (A d' - q + (V / n)(1 / T - 1) / tau) / (V / (n p) + C_w),    T' = -(n - 1) T w / V - (T - 1) / tau,

    where V is the volume, q the flow through the vent, w = V' + q, n the exponent, T the temperature relative to the
    walls, tau the time constant of the heat. Flow and heat relax exactly, however fast they are. Gas that enters has
    the temperature of the gas inside. If more than the volume is displaced, only wall and vent yield from then on.
    """
    area, slope, whole, pressure, exponent, bulge, opening, heat_s = params
    rise, warmth, spent = state
    swept0 = area * d0 + 0.5 * slope * d0 * d0
    swept1 = area * d1 + 0.5 * slope * d1 * d1
    lowest = -0.9 * pressure
    warm = heat_s < math.inf
    kept = 1.0
    if warm:
        kept = math.exp(-h / heat_s)
        exponent = 1.0 + (exponent - 1.0) * phi1(h / heat_s, kept)

    # The effect of the heat is expressed as an equivalent swept volume.
    volume = max(whole - swept0 + bulge * rise, LEAST_M3)
    heated = _heated(volume, warmth, warmth, kept, exponent) if warm else 0.0
    own = _give(volume, pressure + rise, exponent)
    stiff = 1.0 / (own + bulge)
    middle, through = rise + 0.5 * (swept1 - swept0 + heated) * stiff, 0.0
    if opening > 0.0:
        # A backward step is enough here: it only determines the conductance and the volume at the middle.
        middle, through = vented(opening, middle, 0.5 * h * stiff)
    if middle < lowest:
        middle = lowest
    half = 0.0
    if warm:
        taken = 0.5 * heated - own * (middle - rise)
        half = 0.5 * warmth * (1.0 + kept) - (exponent - 1.0) * taken / volume

    volume = max(whole - 0.5 * (swept0 + swept1) + bulge * middle, LEAST_M3)
    if warm:
        heated = _heated(volume, warmth, half, kept, exponent)
    steep = exponent * (pressure + middle)
    stiff = steep / (volume + bulge * steep)
    last_rise = rise
    if opening > 0.0:
        x = h * through * stiff
        decay = math.exp(-x)
        # The vent has had less time for the volume that is swept at the end of the step.
        late = ((area + slope * d1) * v1 * h - (swept1 - swept0)) * phi_ramp(x, decay)
        rise = rise * decay + ((swept1 - swept0 + heated) * phi1(x, decay) + late) * stiff
    else:
        rise += (swept1 - swept0 + heated) * stiff
    if rise < lowest:
        rise = lowest
    if warm:
        taken = heated - volume / steep * (rise - last_rise)
        warmth = warmth * kept - (exponent - 1.0) * (1.0 + half) * taken / volume
    if whole - swept1 + bulge * rise <= LEAST_M3:
        spent = 1
    return (area + slope * d1) * rise, GasState(rise, warmth, spent)


def _give(volume_m3: float, pressure_pa: float, exponent: float) -> float:
    """Return the compliance of the gas (m3/Pa): the change of its volume per change of its pressure."""
    return volume_m3 / (exponent * pressure_pa)


def _heated(volume_m3: float, warmth: float, half: float, kept: float, exponent: float) -> float:
    """Return the swept volume (m3) with the same effect as the heat exchanged in a step, negative while the gas cools.

    `exponent` is the effective exponent of the step; it already includes the heat that the compression in this step
    produces and loses.
    """
    return volume_m3 * warmth * (kept - 1.0) / ((1.0 + half) * exponent)


def rates(params: Gas, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return the rates at which the vent and the walls relax the gas; the vent's at the pressure that builds up."""
    sealed = params._replace(vent_m2=0.0, heat_s=math.inf)
    force, _ = gas(sealed, GasState(0.0), 0.0, point.compression_m, 1.0, 0.0)
    area = params.area_m2 + params.area_slope_m * point.compression_m
    rise = abs(force) / area if area > 0.0 else 0.0
    relaxes = []
    if params.vent_m2 > 0.0:
        # The pressure is bounded by the one that drives the swept volume out.
        through = area * point.speed_m_s
        for _ in range(60):
            rise = min(rise, through / conductance(params.vent_m2, rise))
        give = _give(params.volume_m3, params.pressure_pa, params.exponent) + params.bulge_m3_pa
        relaxes.append(Rate("relaxes", conductance(params.vent_m2, rise) / give))
    if params.heat_s < math.inf:
        relaxes.append(Rate("relaxes", 1.0 / params.heat_s))
    return tuple(relaxes)


def beyond(state: GasState) -> str:
    """Return what happened if more volume was displaced than the gas had."""
    return (
        "more than its volume was displaced; from then on only the wall and the vent yielded"
        if state.spent == 1
        else ""
    )


TERM = Term(
    name="gas",
    summary="trapped gas with a compliant wall, a vent and heat exchange",
    params=Gas,
    law=gas,
    at_rest=GasState(0.0),
    rates=rates,
    positive=("volume_m3", "pressure_pa", "exponent", "heat_s"),
    beyond=beyond,
)
