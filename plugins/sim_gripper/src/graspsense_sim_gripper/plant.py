"""The gripper and what it squeezes: one degree of freedom, the motor angle, with a true stuck state.

The balance on the gap p is that of a geared pair of fingers,

    m(p) p'' + 1/2 m'(p) p'^2 = -F + (N_l + N_r)/2 - friction - b p',

with m(p) = (2 pi / (dp/dMR))^2 J, the rotor's inertia J seen through the transmission. It is integrated in the
motor angle, where the inertia is constant and the m' term is none; 73 to 123 kg on the gap of a PR2, beside which
the fingers' own 0.2 kg vanish. Friction is Coulomb, Stribeck and a part that grows with the load on the screw;
below breakaway nothing moves at all. A step is a kick, a drift and a kick (second order); contact, stop and
reversal are located inside it.

The object is free on a table, its mass negligible beside m: a finger that touches first pushes it, with the
table's friction on that pad, until both touch. Or it is held fast, and each finger presses its own half.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import ScrewLinkage, gap_and_rate
from graspsense_sim_gripper.terms.relaxation import mean_share

EVENTS_A_STEP: Final = 16
"""A step is cut at most this often; the rest is then taken whole."""
SEARCH: Final = 40
"""Most steps of the search for the object's share of the compression."""
FORCE_ROUNDING_N: Final = 1e-7
FORCE_ROUNDING: Final = 1e-9
"""The search ends where the force balances to this, absolute and relative."""
LAG_PIECES: Final = 4
MOST_LAG_PIECES: Final = 1000
"""Where the drive lags, its effort is taken in so many pieces a time constant, each at its mean."""


class Drive(NamedTuple):
    """The gripper: linkage, rotor, friction, ends of travel."""

    link: ScrewLinkage
    inertia: float
    """(2 pi)^2 times the rotor's inertia, kg m2: force on the gap times its rate, over this, is rev/s2."""
    coulomb_n: float
    breakaway_n: float
    stribeck_m_s: float
    load_share: float
    """Friction added per newton of mean pad force."""
    damping_n_s_m: float
    closed_rev: float
    open_rev: float
    lag_s: float = 0.0
    """Time constant with which the effort follows what is asked for; 0: at once."""


class Skin(NamedTuple):
    """What the two covers do beside being a spring, in series as that is: a damper, and an arm that creeps."""

    damping_n_s_m: float
    arm_n_m: float
    tau_s: float


class Thing(NamedTuple):
    """What stands between the fingers. `terms` are the parameters of its terms, in order."""

    width_m: float
    table_n: float
    """Friction of the table that the finger touching first has to overcome."""
    skins_n_m: float
    """Stiffness of the two fingertip covers in series; `inf`: rigid covers."""
    terms: Any
    skin: Skin = Skin(0.0, 0.0, 1.0)
    held: int = 0
    """1: held fast where it stands, so that a finger which touches first presses it and does not push it."""


class PlantParams(NamedTuple):
    """The drive, the object, and in how many steps a tick is taken while they are near each other."""

    drive: Drive
    thing: Thing
    substeps: int


class Squeezed(NamedTuple):
    """The object's compression, the force that goes with it, its last slope, and its terms' states."""

    compression_m: float
    force_n: float
    slope_n_m: float
    states: Any
    cover_m: float
    """Compression of the two covers, kept where they creep or damp."""
    arm_n: float


class PlantState(NamedTuple):
    """Motor angle and speed (revolutions), the gap with its rate, forces on the pads, the object's state."""

    revolutions: float
    speed_rev_s: float
    gap_m: float
    rate_m_rev: float
    left_n: float
    right_n: float
    offset_m: float
    """Where the object stands off the gripper's centre line; positive is nearer the right finger."""
    touched: int
    squeezed: Squeezed
    """The object; where it is held fast, its half at the left finger, as if the other did the same."""
    peak_n: float
    effort_n: float
    """What the drive gives at the moment, where it lags."""
    right: Squeezed
    """The half at the right finger of an object that is held fast."""


def _unbound(params: Any, states: Any, d0: float, d1: float, h: float) -> tuple[float, Any]:
    raise TypeError("the plant has no terms: bind(squeeze, advance=sum_of(terms))")


advance: Callable[[Any, Any, float, float, float], tuple[float, Any]] = _unbound


def squeeze(thing: Thing, now: Squeezed, closure_m: float, h: float) -> Squeezed:
    """Return the object after the fingers have come to `closure_m` (its width less the gap) within `h`.

    The covers' compression and the object's add up to the closure and carry one force; a secant search finds
    the object's share. Where that force would pull, the object and the covers spring back by themselves, free of
    force.
    """
    d0, force0, slope, states0, cover0, arm0 = now
    skins = thing.skins_n_m
    terms = thing.terms
    if skins == math.inf:
        force, states = advance(terms, states0, d0, closure_m, h)
        if force >= 0.0:
            return Squeezed(closure_m, force, slope, states, cover0, arm0)
        skins = 0.0
    # The covers' force is `skins` times their compression, plus `shift`: a damper and an arm add to both.
    shift = dashed = kept = force = 0.0
    creeps = skins > 0.0 and (thing.skin.damping_n_s_m > 0.0 or thing.skin.arm_n_m > 0.0)
    if creeps:
        x = h / thing.skin.tau_s
        kept = math.exp(-x)
        dashed = thing.skin.arm_n_m * mean_share(x, kept)
        if h > 0.0:
            dashed += thing.skin.damping_n_s_m / h
        skins += dashed
        shift = arm0 * kept - dashed * cover0
    free_cover = -shift / skins if creeps else 0.0
    # Free until now, it is met where it stands; pressed until now, it is let go where its force would pull.
    touching = force0 > 0.0 and skins > 0.0
    d1 = d0
    states = states0
    for attempt in range(3):
        stiff = skins if touching else 0.0
        push = shift if touching else 0.0
        slope = max(now.slope_n_m, 1.0)
        d1 = d0 + (stiff * (closure_m - d0) + push - force0) / (stiff + slope)
        force, states = advance(terms, states0, d0, d1, h)
        residual = force - (stiff * (closure_m - d1) + push)
        for _ in range(SEARCH):
            if abs(residual) <= FORCE_ROUNDING_N + FORCE_ROUNDING * abs(force):
                break
            d2 = d1 - residual / (stiff + slope)
            if d2 == d1:
                break
            force2, states = advance(terms, states0, d0, d2, h)
            # Over less than this the difference of two forces is mostly rounding.
            if abs(d2 - d1) > 1e-13:
                slope = max((force2 - force) / (d2 - d1), 1.0)
            d1, force = d2, force2
            residual = force - (stiff * (closure_m - d1) + push)
        if touching:
            if force >= 0.0:
                break
            touching = False
        else:
            if attempt > 0 or skins == 0.0 or closure_m <= d1 + free_cover:
                break
            touching = True
    if not touching:
        force = 0.0
    if not creeps:
        return Squeezed(d1, force, slope, states, cover0, arm0)
    cover = closure_m - d1 if touching else free_cover
    arm = arm0 * kept + thing.skin.arm_n_m * mean_share(h / thing.skin.tau_s, kept) * (cover - cover0)
    return Squeezed(d1, force, slope, states, cover, arm)


def friction(drive: Drive, velocity_m_s: float, load_n: float) -> float:
    """Return the sliding friction (N, positive) at this speed of the gap and this mean pad force."""
    x = velocity_m_s / drive.stribeck_m_s
    force = drive.coulomb_n + drive.load_share * load_n
    # Beyond that less than 2e-9 of it is left.
    if -4.5 < x < 4.5:
        force += (drive.breakaway_n - drive.coulomb_n) * math.exp(-x * x)
    return force


def move(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt` in which this effort was asked for (N, positive squeezes)."""
    lag = params.drive.lag_s
    if lag <= 0.0:
        return _driven(params, state, effort_n, dt)
    pieces = min(max(math.ceil(LAG_PIECES * dt / lag), 1), MOST_LAG_PIECES)
    h = dt / pieces
    for _ in range(pieces):
        decay = math.exp(-h / lag)
        short = state.effort_n - effort_n
        given = effort_n + short * mean_share(h / lag, decay)
        state = _with_effort(state, effort_n + short * decay)
        state = _driven(params, state, given, h)
    return state


def _with_effort(state: PlantState, effort_n: float) -> PlantState:
    revolutions, speed, gap, rate, left, right, offset, touched, squeezed, peak, _, other = state
    return PlantState(
        revolutions, speed, gap, rate, left, right, offset, touched, squeezed, peak, effort_n, other
    )


def _driven(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt` under a constant effort."""
    drive, thing, steps = params
    if state.touched == 0:
        # Most ticks are one free piece of motion, or none.
        state1, used = _piece(drive, thing, state, effort_n, dt, False)
        if used == dt and state1.touched == 0:
            return state1
    if steps > 1 and state.gap_m - thing.width_m - 2.0 * abs(state.offset_m) > dt:
        # Further off than a metre a second would take it.
        steps = 1
    h = dt / steps
    for _ in range(steps):
        left = h
        for event in range(EVENTS_A_STEP):
            state, used = _piece(drive, thing, state, effort_n, left, event == EVENTS_A_STEP - 1)
            left -= used
            if left <= 1e-12 * h:
                break
    return state


def _piece(
    drive: Drive, thing: Thing, state: PlantState, effort_n: float, h: float, whole: bool
) -> tuple[PlantState, float]:
    """Return the plant after one piece of motion without an event inside, and how long it took."""
    revolutions, speed, gap, rate, left, right, offset, touched, squeezed, peak, given, other = state
    load = 0.5 * (left + right)
    net = load - effort_n
    gain = rate / drive.inertia

    if speed == 0.0:
        resisting = drive.breakaway_n + drive.load_share * load
        if (
            abs(net) <= resisting
            or (net > 0.0 and revolutions >= drive.open_rev)
            or (net < 0.0 and revolutions <= drive.closed_rev)
        ):
            if touched == 0:
                return state, h
            left, right, offset, squeezed, other = _felt(thing, state, gap, h, True)
            peak = max(peak, squeezed.force_n, other.force_n)
            return PlantState(
                revolutions, 0.0, gap, rate, left, right, offset, touched, squeezed, peak, given, other
            ), h
        direction = 1.0 if net > 0.0 else -1.0
    else:
        direction = 1.0 if speed > 0.0 else -1.0
        resisting = friction(drive, speed * rate, load)
    kick = gain * (net - direction * resisting - drive.damping_n_s_m * speed * rate)

    used = h
    stops = speed != 0.0 and (speed + kick * h) * direction <= 0.0 and not whole
    if stops:
        used = min(-speed / kick, h)
    revolutions1 = revolutions + used * (speed + 0.5 * kick * used)
    gap1, rate1 = gap_and_rate(drive.link, revolutions1)

    # The gap at which a finger touches, or once one does, the second.
    reach = thing.width_m + 2.0 * abs(offset)
    touching = reach if gap > reach else thing.width_m - (2.0 * abs(offset) if thing.held == 1 else 0.0)
    if gap > touching > gap1 and not whole:
        used = used * (gap - touching) / (gap - gap1)
        stops = False
        revolutions1 = revolutions + used * (speed + 0.5 * kick * used)
        gap1, rate1 = gap_and_rate(drive.link, revolutions1)
        gap1 = min(gap1, touching)

    if touched == 1 or gap1 <= reach:
        left, right, offset, squeezed, other = _felt(thing, state, gap1, used, False)
        touched = 1
        peak = max(peak, squeezed.force_n, other.force_n)
        load = 0.5 * (left + right)

    if stops:
        speed1 = 0.0
    else:
        guess = speed + kick * used
        resisting = friction(drive, guess * rate1, load)
        kick1 = (
            rate1
            / drive.inertia
            * (load - effort_n - direction * resisting - drive.damping_n_s_m * guess * rate1)
        )
        speed1 = speed + 0.5 * used * (kick + kick1)
        if speed1 * direction < 0.0:
            speed1 = 0.0
    if revolutions1 >= drive.open_rev and speed1 >= 0.0:
        revolutions1, speed1 = drive.open_rev, 0.0
        gap1, rate1 = gap_and_rate(drive.link, revolutions1)
    elif revolutions1 <= drive.closed_rev and speed1 <= 0.0:
        revolutions1, speed1 = drive.closed_rev, 0.0
        gap1, rate1 = gap_and_rate(drive.link, revolutions1)
    return PlantState(
        revolutions1, speed1, gap1, rate1, left, right, offset, touched, squeezed, peak, given, other
    ), used


def _felt(
    thing: Thing, state: PlantState, gap_m: float, h: float, still: bool
) -> tuple[float, float, float, Squeezed, Squeezed]:
    """Return the forces on the pads at this gap, reached in `h`, where the object then stands, and its state.

    `still`: the fingers did not move.
    """
    closure = thing.width_m - gap_m
    offset = state.offset_m
    left = right = 0.0
    if still:
        # A pad that alone holds the object against the table goes on doing so.
        left, right = min(state.left_n, thing.table_n), min(state.right_n, thing.table_n)
    elif thing.held == 0 and -closure <= 2.0 * abs(offset):
        pushed = 0.5 * max(-closure, 0.0)
        if pushed < abs(offset):
            right = thing.table_n if offset > 0.0 else 0.0
            left = thing.table_n - right
        elif closure > 0.0:
            left, right = min(state.left_n, thing.table_n), min(state.right_n, thing.table_n)
        offset = pushed if offset >= 0.0 else -pushed
    # Held fast, each finger presses its own half as if the other did the same; free, both press the whole.
    squeezed, other = state.squeezed, state.right
    shift = 2.0 * offset if thing.held == 1 else 0.0
    for half in range(1 + thing.held):
        one = squeezed if half == 0 else other
        shut = closure - shift if half == 0 else closure + shift
        if still or shut > 0.0 or one.compression_m != 0.0:
            one = squeeze(thing, one, shut, h)
        if half == 0:
            squeezed = one
        else:
            other = one
    if thing.held == 1:
        return squeezed.force_n, other.force_n, offset, squeezed, other
    force = squeezed.force_n
    return max(force, left), max(force, right), offset, squeezed, other
