"""A surface that gives: a mass on a spring and a damper behind the contact."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.terms.oscillator import Motion, moved
from graspsense_sim_gripper.terms.term import Rate, Term, WorkingPoint

MOST_LOOKS: Final = 4096
CLOSER: Final = 45


class Surface(NamedTuple):
    """A mass on a spring and a damper, met through a contact spring that can only push."""

    mass_kg: float
    k_n_m: float
    damping_n_s_m: float
    contact_n_m: float


def surface(params: Surface, state: Motion, d0: float, d1: float, h: float) -> tuple[float, Motion]:
    """Return the contact's force: exact motion between contacts, each contact and parting located.

    It looks at the contact at least twelve times in a swing, as a light mass bounces many times in a tick.
    """
    mass, k, damping, contact = params
    a = 0.5 * damping / mass
    if h <= 0.0:
        return contact * max(d1 - state.y_m, 0.0), state
    speed = (d1 - d0) / h
    looks = math.ceil(math.sqrt((k + contact) / mass) * h / 0.5)
    step = h / min(max(looks, 1), MOST_LOOKS)
    t = 0.0
    touching = d0 - state.y_m > 0.0 or (d0 == state.y_m and speed > state.v_m_s)
    while t < h * (1.0 - 1e-12):
        ahead = min(step, h - t)
        square = (k + contact) / mass if touching else k / mass
        pull = contact / mass if touching else 0.0
        d = d0 + speed * t
        after = moved(state, a, square, pull * d, pull * speed, ahead)
        if (d + speed * ahead - after.y_m > 0.0) != touching:
            # Bisect for the instant at which it meets or parts.
            least, most = 0.0, ahead
            for _ in range(CLOSER):
                ahead = 0.5 * (least + most)
                after = moved(state, a, square, pull * d, pull * speed, ahead)
                if (d + speed * ahead - after.y_m > 0.0) == touching:
                    least = ahead
                else:
                    most = ahead
            ahead = most
            after = moved(state, a, square, pull * d, pull * speed, ahead)
            touching = not touching
        state = after
        t += ahead
    return contact * max(d1 - state.y_m, 0.0), state


def rates(params: Surface, at: WorkingPoint) -> tuple[Rate, ...]:
    """Return the natural frequencies, in contact and parted."""
    return (
        Rate("swings", math.sqrt((params.k_n_m + params.contact_n_m) / params.mass_kg)),
        Rate("swings", math.sqrt(params.k_n_m / params.mass_kg)),
    )


TERM = Term(
    name="surface",
    summary="mass on a spring and a damper behind a contact that can only push",
    params=Surface,
    law=surface,
    at_rest=Motion(0.0, 0.0),
    rates=rates,
    positive=("mass_kg", "k_n_m", "contact_n_m"),
    stiffnesses=("k_n_m",),
)
