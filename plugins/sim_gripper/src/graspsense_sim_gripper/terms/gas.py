"""Gas trapped in a container, which may leak and may exchange heat with its walls."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.terms.phi import phi1, phi_ramp
from graspsense_sim_gripper.terms.term import Limit, Rate, Term, WorkingPoint
from graspsense_sim_gripper.terms.vent import conductance, vented

LEAST_M3: Final = 1e-9
"""A millilitre in a thousand is the least it holds."""


class Gas(NamedTuple):
    """Gas behind a wall that gives: displaced volume A0 d + A1 d^2 / 2, wall bulge C_w beside it.

    `exponent` is 1 where the gas stays at its walls' temperature during a grasp (a small head space), 1.4 where
    it does not; with `heat_s` it falls from the one to the other in that time. The pressure it stood at before
    the grasp is carried by the wall and pushes nothing, and drives nothing through the vent.
    """

    area_m2: float
    area_slope_m: float
    volume_m3: float
    pressure_pa: float
    exponent: float
    bulge_m3_pa: float
    vent_m2: float = 0.0
    """Area of an opening, from a pinhole to an open neck; 0: sealed."""
    heat_s: float = math.inf
    """Time constant with which the gas takes its walls' temperature."""


class GasState(NamedTuple):
    """Pressure above that at rest (Pa), and temperature above the walls' as a share of it."""

    rise_pa: float
    warmth: float = 0.0
    spent: int = 0
    """1: it was pressed by more than it held, so that only the wall and the vent were left to give way."""


def gas(params: Gas, state: GasState, d0: float, d1: float, h: float, v1: float) -> tuple[float, GasState]:
    """Return the force of the pressure rise, an exponential midpoint step of second order.

    With V the volume and w = V' + q what it and the vent's flow q take from the gas,

        p' = (A d' - q + (V / n)(1 / T - 1) / tau) / (V / (n p) + C_w),    T' = -(n - 1) T w / V - (T - 1) / tau,

    n the exponent, T the temperature over the walls', tau the heat's time constant: the gas laws of an ideal gas
    with heat to walls that stay as warm as they are. Vent and heat relax exactly, however fast they are; what
    comes in through the vent is taken to be as warm as what is there. Pressed by more than it holds the gas is gone,
    and what it was in no longer gives but by its wall and its vent.
    """
    area, slope, whole, pressure, exponent, bulge, opening, heat_s = params
    rise, warmth, spent = state
    swept0 = area * d0 + 0.5 * slope * d0 * d0
    swept1 = area * d1 + 0.5 * slope * d1 * d1
    lowest = -0.9 * pressure
    warm = heat_s < math.inf
    kept, heat_share = 1.0, 1.0
    if warm:
        kept = math.exp(-h / heat_s)
        heat_share = phi1(h / heat_s, kept)
        exponent = 1.0 + (exponent - 1.0) * heat_share

    # What the heat adds, as if it were swept volume.
    volume = max(whole - swept0 + bulge * rise, LEAST_M3)
    heated = _heated(volume, warmth, warmth, kept, exponent) if warm else 0.0
    own = _give(volume, pressure + rise, exponent)
    stiff = 1.0 / (own + bulge)
    middle, through = rise + 0.5 * (swept1 - swept0 + heated) * stiff, 0.0
    if opening > 0.0:
        # By a backward step: it only says what the conductance and the volume are there.
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
    before = rise
    if opening > 0.0:
        x = h * through * stiff
        decay = math.exp(-x)
        # What is swept faster at the end than in the mean the vent has had less time for.
        late = ((area + slope * d1) * v1 * h - (swept1 - swept0)) * phi_ramp(x, decay)
        rise = rise * decay + ((swept1 - swept0 + heated) * phi1(x, decay) + late) * stiff
    else:
        rise += (swept1 - swept0 + heated) * stiff
    if rise < lowest:
        rise = lowest
    if warm:
        taken = heated - volume / steep * (rise - before)
        warmth = warmth * kept - (exponent - 1.0) * (1.0 + half) * taken / volume
    if whole - swept1 + bulge * rise <= LEAST_M3:
        spent = 1
    return (area + slope * d1) * rise, GasState(rise, warmth, spent)


def _give(volume_m3: float, pressure_pa: float, exponent: float) -> float:
    """Return how much volume (m3) the gas gives a pascal."""
    return volume_m3 / (exponent * pressure_pa)


def _heated(volume_m3: float, warmth: float, half: float, kept: float, exponent: float) -> float:
    """Return what the heat exchanged in a piece is worth as swept volume (m3), negative while the gas cools.

    `exponent` is the one that holds over the piece, with the share of the heat that compression makes and loses
    meanwhile in it already.
    """
    return volume_m3 * warmth * (kept - 1.0) / ((1.0 + half) * exponent)


def rates(params: Gas, at: WorkingPoint) -> tuple[Rate, ...]:
    """Return how fast the vent and the walls relax the gas, the vent at the pressure that builds up."""
    sealed = params._replace(vent_m2=0.0, heat_s=math.inf)
    force, _ = gas(sealed, GasState(0.0), 0.0, at.compression_m, 1.0, 0.0)
    area = params.area_m2 + params.area_slope_m * at.compression_m
    rise = abs(force) / area if area > 0.0 else 0.0
    found = []
    if params.vent_m2 > 0.0:
        # No more builds up than drives the swept volume out.
        through = area * at.speed_m_s
        for _ in range(60):
            rise = min(rise, through / conductance(params.vent_m2, rise))
        give = _give(params.volume_m3, params.pressure_pa, params.exponent) + params.bulge_m3_pa
        found.append(Rate("relaxes", conductance(params.vent_m2, rise) / give))
    if params.heat_s < math.inf:
        found.append(Rate("relaxes", 1.0 / params.heat_s))
    return tuple(found)


def limits(params: Gas, at: WorkingPoint) -> tuple[Limit, ...]:
    """Return it as a spring, and without the vent, the heat or both, at its walls' temperature or with none of it."""
    found = []
    for name, exponent in (("isothermal", 1.0), ("adiabatic", params.exponent)):
        give = _give(params.volume_m3, params.pressure_pa, exponent) + params.bulge_m3_pa
        sealed = params._replace(vent_m2=0.0, heat_s=math.inf, exponent=exponent)
        found.append(Limit(f"{name} spring", spring_n_m=params.area_m2 * params.area_m2 / give))
        found.append(Limit(f"sealed, {name}", sealed))
        if params.vent_m2 > 0.0:
            found.append(Limit(name, sealed._replace(vent_m2=params.vent_m2)))
    found.append(Limit("sealed", params._replace(vent_m2=0.0)))
    return tuple(found)


def beyond(state: GasState) -> str:
    """Return what happened where more was displaced than there was gas."""
    return "pressed by more than it holds; from there on only wall and vent gave" if state.spent == 1 else ""


TERM = Term(
    name="gas",
    summary="trapped gas with the wall's bulge, a vent and heat to the walls",
    params=Gas,
    law=gas,
    at_rest=GasState(0.0),
    rates=rates,
    limits=limits,
    positive=("volume_m3", "pressure_pa", "exponent", "heat_s"),
    beyond=beyond,
)
