"""A compliant surface: a mass on a spring and a damper behind the contact."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.scene.terms.oscillator import Forcing, OscillatorState, moved
from graspsense_sim_gripper.scene.terms.phi import phi1, phi_ramp
from graspsense_sim_gripper.scene.terms.term import Rate, Term, WorkingPoint

MAX_CHECKS: Final = 64
BISECTIONS: Final = 45
LEAST_SHARE: Final = 1e-3
STILL_M: Final = 1e-12
STILL_M_S: Final = 1e-9
"""A mass that is nearer to its rest than the first and slower than the second is at rest."""


class Surface(NamedTuple):
    """A mass on a spring and a damper, behind a contact spring that can only push."""

    mass_kg: float
    k_n_m: float
    damping_n_s_m: float
    contact_n_m: float


def surface(
    params: Surface, state: OscillatorState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, OscillatorState]:
    """Return the contact force: exact motion between contacts, with each contact and separation located in time.

    A light mass can bounce many times within a step, so the contact is checked at least twelve times per oscillation,
    but at most `MAX_CHECKS` times. Shorter steps resolve more oscillations.
    """
    mass, k, damping, contact = params
    if mass <= 0.0:
        return _massless(params, state, d0, d1, h, v1)
    a = 0.5 * damping / mass
    if h <= 0.0:
        return contact * max(d1 - state.y_m, 0.0), state
    mean = (d1 - d0) / h
    speed, bend = 2.0 * mean - v1, (v1 - mean) / h
    checks = math.ceil(math.sqrt((k + contact) / mass) * h / 0.5)
    step = h / min(max(checks, 1), MAX_CHECKS)
    t = 0.0
    touching = d0 - state.y_m > 0.0 or (d0 == state.y_m and speed > state.v_m_s)
    while t < h * (1.0 - 1e-12):
        ahead = min(step, h - t)
        square = (k + contact) / mass if touching else k / mass
        pull = contact / mass if touching else 0.0
        # The compression is d + rate u + bend u² at the time u from here.
        d, rate = d0 + t * (speed + bend * t), speed + 2.0 * bend * t
        forcing = Forcing(pull * d, pull * rate, pull * bend)
        after = moved(state, a, square, forcing, ahead)
        if (d + ahead * (rate + bend * ahead) - after.y_m > 0.0) != touching:
            # Bisect for the time of the contact or separation.
            least, most = 0.0, ahead
            for _ in range(BISECTIONS):
                ahead = 0.5 * (least + most)
                after = moved(state, a, square, forcing, ahead)
                if (d + ahead * (rate + bend * ahead) - after.y_m > 0.0) == touching:
                    least = ahead
                else:
                    most = ahead
            # Without it, a grazing contact would be found repeatedly at the same time.
            ahead = max(most, LEAST_SHARE * step)
            after = moved(state, a, square, forcing, ahead)
            touching = not touching
        state = after
        t += ahead
    return contact * max(d1 - state.y_m, 0.0), state


def _massless(
    params: Surface, state: OscillatorState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, OscillatorState]:
    """Return the contact force without a mass: the support relaxes towards equilibrium."""
    _, k, damping, contact = params
    both = k + contact
    if damping <= 0.0:
        y = max(contact * d1 / both, 0.0)
        return contact * max(d1 - y, 0.0), OscillatorState(y, 0.0)
    x = h * both / damping
    decay = math.exp(-x)
    late = phi_ramp(x, decay)
    # Distance from equilibrium.
    share = contact / both
    behind = (share * d0 - state.y_m) * decay + share * ((d1 - d0) * (phi1(x, decay) - late) + h * v1 * late)
    y = share * d1 - behind
    if d1 - y < 0.0:
        y = state.y_m * math.exp(-h * k / damping)
    return contact * max(d1 - y, 0.0), OscillatorState(y, 0.0)


def moves(state: OscillatorState) -> bool:
    """Return whether the mass, or without a mass its support, is not at rest."""
    return abs(state.y_m) > STILL_M or abs(state.v_m_s) > STILL_M_S


def rates(params: Surface, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return the natural frequencies in contact and separated."""
    return (
        Rate("swings", math.sqrt((params.k_n_m + params.contact_n_m) / params.mass_kg)),
        Rate("swings", math.sqrt(params.k_n_m / params.mass_kg)),
    )


TERM = Term(
    name="surface",
    summary="mass on a spring and a damper behind a contact that can only push",
    params=Surface,
    law=surface,
    at_rest=OscillatorState(0.0, 0.0),
    rates=rates,
    moves=moves,
    divides_steps=True,
    positive=("mass_kg", "k_n_m", "contact_n_m"),
    stiffnesses=("k_n_m",),
)
