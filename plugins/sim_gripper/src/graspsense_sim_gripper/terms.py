"""What an object can be made of: terms that each add force when the object is compressed.

A term is a pure function `term(params, state, d0, d1, h) -> (force, state)`: the compression goes from `d0` to
`d1` (m) in `h` (s), and it returns the force (N) at the end and its state there. It integrates itself over that
straight piece of path, so that a stiff state of its own needs no small step. It runs in the interpreter and
compiled; parameters and states are named tuples of floats and integers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

ATMOSPHERE_PA: Final = 101325.0


class NoState(NamedTuple):
    """The state of a term that remembers nothing."""


class Elastic(NamedTuple):
    """An elastic shell: force k1 d + k3 d^3."""

    k1_n_m: float
    k3_n_m3: float


def elastic(params: Elastic, state: NoState, d0: float, d1: float, h: float) -> tuple[float, NoState]:
    """Return the shell's force."""
    return params.k1_n_m * d1 + params.k3_n_m3 * d1 * d1 * d1, state


class Rigid(NamedTuple):
    """A rigid body felt through its Hertz contact, K d^1.5; above the crush force it breaks for good."""

    hertz_n_m15: float
    crush_force_n: float
    broken_n_m: float
    """Stiffness of what is left."""


class RigidState(NamedTuple):
    """Whether it has broken (0 or 1)."""

    broken: int


def rigid(params: Rigid, state: RigidState, d0: float, d1: float, h: float) -> tuple[float, RigidState]:
    """Return the contact force; a break is felt from the next piece of path on."""
    if state.broken == 1:
        return params.broken_n_m * d1, state
    # Odd in d, so that a search that strays below zero still finds its way back.
    force = params.hertz_n_m15 * d1 * math.sqrt(abs(d1))
    if force > params.crush_force_n:
        return force, RigidState(1)
    return force, state


class Maxwell(NamedTuple):
    """A viscoelastic branch: a spring k in series with a damper k tau."""

    k_n_m: float
    tau_s: float


class MaxwellState(NamedTuple):
    """The branch's force."""

    force_n: float


def maxwell(
    params: Maxwell, state: MaxwellState, d0: float, d1: float, h: float
) -> tuple[float, MaxwellState]:
    """Return the branch's force, exact for a straight path: q' = k d' - q / tau."""
    x = h / params.tau_s
    decay = math.exp(-x)
    share = (1.0 - decay) / x if x > 1e-6 else 1.0 - 0.5 * x
    force = state.force_n * decay + params.k_n_m * (d1 - d0) * share
    return force, MaxwellState(force)


class Gas(NamedTuple):
    """Gas trapped behind a wall that gives: displaced volume A0 d + A1 d^2 / 2, wall bulge C_w beside it.

    `exponent` is 1 where the gas stays at its walls' temperature during a grasp (a small head space), 1.4 where
    it does not. The pressure it stood at before the grasp is carried by the wall and pushes nothing.
    """

    area_m2: float
    area_slope_m: float
    volume_m3: float
    pressure_pa: float
    exponent: float
    bulge_m3_pa: float


class GasState(NamedTuple):
    """Pressure above that at rest, Pa."""

    rise_pa: float


def gas(params: Gas, state: GasState, d0: float, d1: float, h: float) -> tuple[float, GasState]:
    """Return the force of the pressure rise: p' = A d' / (V / (n p) + C_w), midpoint rule."""
    area, slope, whole, pressure, exponent, bulge = params
    rise = state.rise_pa
    swept0 = area * d0 + 0.5 * slope * d0 * d0
    swept1 = area * d1 + 0.5 * slope * d1 * d1
    lowest = -0.9 * pressure
    give = _give(whole - swept0 + bulge * rise, pressure + rise, exponent) + bulge
    middle = rise + 0.5 * (swept1 - swept0) / give
    if middle < lowest:
        middle = lowest
    volume = whole - 0.5 * (swept0 + swept1) + bulge * middle
    rise += (swept1 - swept0) / (_give(volume, pressure + middle, exponent) + bulge)
    if rise < lowest:
        rise = lowest
    return (area + slope * d1) * rise, GasState(rise)


def _give(volume_m3: float, pressure_pa: float, exponent: float) -> float:
    """Return how much volume (m3) the gas gives a pascal; a millilitre in a thousand is the least it holds."""
    return (volume_m3 if volume_m3 > 1e-9 else 1e-9) / (exponent * pressure_pa)


class Loss(NamedTuple):
    """What the contents dissipate: a damper on the compression. Fitted, not derived (see the catalogue)."""

    damping_n_s_m: float


def loss(params: Loss, state: NoState, d0: float, d1: float, h: float) -> tuple[float, NoState]:
    """Return the damper's mean force over the piece."""
    if h <= 0.0:
        return 0.0, state
    return params.damping_n_s_m * (d1 - d0) / h, state


Law = Callable[[Any, Any, float, float, float], tuple[float, Any]]

TERMS: Final[dict[str, tuple[type, Law, Any]]] = {
    "elastic": (Elastic, elastic, NoState()),
    "rigid": (Rigid, rigid, RigidState(0)),
    "maxwell": (Maxwell, maxwell, MaxwellState(0.0)),
    "gas": (Gas, gas, GasState(0.0)),
    "loss": (Loss, loss, NoState()),
}
"""Name in a catalogue to parameters, law and the state at rest. Scenes list terms in this order."""
