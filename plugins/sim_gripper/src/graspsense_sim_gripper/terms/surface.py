"""A surface that gives: a mass on a spring and a damper behind the contact."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.terms.oscillator import OscillatorState, moved
from graspsense_sim_gripper.terms.phi import phi1, phi_ramp
from graspsense_sim_gripper.terms.term import Limit, LinearForm, OwnContact, Rate, Term, WorkingPoint

MOST_LOOKS: Final = 64
CLOSER: Final = 45
LEAST_SHARE: Final = 1e-3


class Surface(NamedTuple):
    """A mass on a spring and a damper, met through a contact spring that can only push."""

    mass_kg: float
    k_n_m: float
    damping_n_s_m: float
    contact_n_m: float


def surface(
    params: Surface, state: OscillatorState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, OscillatorState]:
    """Return the contact's force: exact motion between contacts, each contact and parting located.

    It looks at the contact at least twelve times in a swing, as a light mass bounces many times in a tick, and at most
    `MOST_LOOKS` times: whoever wants to see more swings than that takes shorter pieces.
    """
    mass, k, damping, contact = params
    if mass <= 0.0:
        return _massless(params, state, d0, d1, h, v1)
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
            # A graze would be met again and again at one instant.
            ahead = max(most, LEAST_SHARE * step)
            after = moved(state, a, square, pull * d, pull * speed, ahead)
            touching = not touching
        state = after
        t += ahead
    return contact * max(d1 - state.y_m, 0.0), state


def _massless(
    params: Surface, state: OscillatorState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, OscillatorState]:
    """Return the contact's force where the mass is none: what it stands on relaxes towards the balance."""
    _, k, damping, contact = params
    both = k + contact
    if damping <= 0.0:
        y = max(contact * d1 / both, 0.0)
        return contact * max(d1 - y, 0.0), OscillatorState(y, 0.0)
    x = h * both / damping
    decay = math.exp(-x)
    late = phi_ramp(x, decay)
    # What it lags behind the balance.
    share = contact / both
    behind = (share * d0 - state.y_m) * decay + share * ((d1 - d0) * (phi1(x, decay) - late) + h * v1 * late)
    y = share * d1 - behind
    if d1 - y < 0.0:
        y = state.y_m * math.exp(-h * k / damping)
    return contact * max(d1 - y, 0.0), OscillatorState(y, 0.0)


def rates(params: Surface, at: WorkingPoint) -> tuple[Rate, ...]:
    """Return the natural frequencies, in contact and parted."""
    return (
        Rate("swings", math.sqrt((params.k_n_m + params.contact_n_m) / params.mass_kg)),
        Rate("swings", math.sqrt(params.k_n_m / params.mass_kg)),
    )


def limits(params: Surface, at: WorkingPoint) -> tuple[Limit, ...]:
    """Return what it is without its mass, with so much that it stands, and where its damper does nothing either."""
    _, k, _, contact = params
    return (
        Limit("springs in series", spring_n_m=k * contact / (k + contact)),
        Limit("wall", spring_n_m=contact),
        Limit("massless", params._replace(mass_kg=0.0)),
    )


def linear(params: Surface) -> OwnContact | None:
    """Return its motion in contact and parted; without mass and damper it has none, being a spring at once."""
    mass, k, damping, contact = params

    def form(by: float) -> LinearForm:
        if mass > 0.0:
            rates = ((0.0, 1.0), (-(k + by) / mass, -damping / mass))
            moved_by = (0.0, by / mass)
        else:
            rates = ((-(k + by) / damping, 0.0), (0.0, 0.0))
            moved_by = (by / damping, 0.0)
        return LinearForm(by, 0.0, rates, moved_by, (0.0, 0.0), (-by, 0.0))

    if mass <= 0.0 and damping <= 0.0:
        return None
    return OwnContact(form(contact), form(0.0), (-1.0, 0.0))


TERM = Term(
    name="surface",
    summary="mass on a spring and a damper behind a contact that can only push",
    params=Surface,
    law=surface,
    at_rest=OscillatorState(0.0, 0.0),
    rates=rates,
    limits=limits,
    linear=linear,
    positive=("mass_kg", "k_n_m", "contact_n_m"),
    stiffnesses=("k_n_m",),
)
