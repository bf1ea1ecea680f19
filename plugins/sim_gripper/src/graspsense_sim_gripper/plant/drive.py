"""The drive: a motor that moves both fingertips through a linkage, with the friction of its screw.

With the gap p as coordinate the equation of motion of the geared pair of fingers is

    m(p) p'' + 1/2 m'(p) p'^2 = (N_left + N_right)/2 - F - friction - b p',    m(p) = (2 pi / (dp/dr))^2 J,

where F is the force of the drive, N the forces of the pads and J the inertia of the rotor. It is integrated with the
motor's angle r (in revolutions) as coordinate, in which the inertia is constant and the term with m' vanishes. On the
gap of a PR2 m is 73 to 123 kg, beside which the 0.2 kg of the fingers are negligible.

Friction is Coulomb friction with a part in proportion to the load on the screw and with the Stribeck effect (Armstrong-
Helouvry, Dupont and Canudas de Wit, Automatica 30, 1994). Below the breakaway force the drive is held: it does not
creep.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense.gripper_api import ScrewLinkage
from graspsense_sim_gripper.plant.state import Contact, Motion, right_of

STRIBECK_SPEEDS: Final = 4.5
"""Multiple of the Stribeck speed beyond which the excess is below 2e-9 of its maximum and counts as zero."""
ARREST_M_S: Final = 1e-8
"""A decelerating drive that is slower than this comes to rest."""


class Friction(NamedTuple):
    """Friction of the drive, as forces on the gap."""

    coulomb_n: float
    breakaway_n: float
    stribeck_m_s: float
    """Speed over which the friction falls from the breakaway force to the Coulomb friction."""
    load_friction_coefficient: float
    """Friction per newton of mean pad force."""
    damping_n_s_m: float
    """Viscous damping."""


class FrictionSpread(NamedTuple):
    """How friction differs between trials (N)."""

    coulomb_n: float
    coulomb_spread_n: float
    """Standard deviation of the Coulomb friction."""
    breakaway_n: float


def drawn_friction(spread: FrictionSpread, draw: float) -> tuple[float, float]:
    """Return the Coulomb and the breakaway friction (N) of a trial with this standard normal draw."""
    coulomb_n = max(spread.coulomb_n + spread.coulomb_spread_n * draw, 0.0)
    return coulomb_n, max(spread.breakaway_n, coulomb_n)


class Drive(NamedTuple):
    """Linkage, inertia, friction and ends of travel."""

    link: ScrewLinkage
    inertia: float
    """(2 pi)^2 times the rotor's inertia (kg m2): force on the gap times dp/dr, over this, is in rev/s2."""
    friction: Friction
    closed_rev: float
    open_rev: float
    lag_s: float = 0.0
    """Time constant with which the force follows the command; 0: without delay."""


def stribeck_excess(friction: Friction, velocity_m_s: float) -> tuple[float, float, float]:
    """Return the excess of friction over Coulomb friction at this speed of the gap, and its first two derivatives.

    The excess is in N, its first derivative with respect to the speed in N s/m, the second in N s2/m2.
    """
    coulomb_n, breakaway_n, stribeck_m_s, _, _ = friction
    excess = breakaway_n - coulomb_n
    if excess > 0.0:
        per_speed = 1.0 / stribeck_m_s
        x = velocity_m_s * per_speed
        if -STRIBECK_SPEEDS < x < STRIBECK_SPEEDS:
            excess *= math.exp(-x * x)
            return (
                excess,
                -2.0 * x * per_speed * excess,
                (4.0 * x * x - 2.0) * per_speed * per_speed * excess,
            )
    return 0.0, 0.0, 0.0


def sliding_friction(friction: Friction, velocity_m_s: float, load_n: float) -> float:
    """Return the friction (N, positive) while sliding at this speed of the gap under this mean pad force."""
    excess, _, _ = stribeck_excess(friction, velocity_m_s)
    return friction.coulomb_n + friction.load_friction_coefficient * load_n + excess


def breakaway_friction(friction: Friction, load_n: float) -> float:
    """Return the friction (N, positive) that has to be overcome from rest under this mean pad force."""
    return friction.breakaway_n + friction.load_friction_coefficient * load_n


def acceleration(
    drive: Drive,
    jacobian_m_rev: float,
    speed_rev_s: float,
    net_n: float,
    friction_n: float,
    direction: float,
) -> float:
    """Return the motor's acceleration (rev/s2) under this net force on the gap, sliding in this direction (+1, -1)."""
    damping_n = drive.friction.damping_n_s_m * speed_rev_s * jacobian_m_rev
    # The same at all ticks, so that a compiler can take the division out of the loop.
    per_inertia = 1.0 / drive.inertia
    return jacobian_m_rev * per_inertia * (net_n - direction * friction_n - damping_n)


def load_at_rest(contact: Contact, effort_n: float) -> float:
    """Return the mean pad force (N) on fingers at rest under this effort.

    Where the object is only pushed against the friction of the table, that friction resists the effort: it never
    exceeds it, and so moves no finger.
    """
    load = 0.5 * (contact.left_n + contact.right_n)
    if contact.left.force_n == 0.0 and right_of(contact.left, contact.right).force_n == 0.0:
        load = min(load, max(effort_n, 0.0))
    return load


def is_held(drive: Drive, motion: Motion, contact: Contact, effort_n: float) -> bool:
    """Return whether a drive at rest stays at rest, held by friction or by an end of its travel."""
    load = load_at_rest(contact, effort_n)
    net = load - effort_n
    return (
        abs(net) <= breakaway_friction(drive.friction, load)
        or (net > 0.0 and motion.revolutions >= drive.open_rev)
        or (net < 0.0 and motion.revolutions <= drive.closed_rev)
    )
