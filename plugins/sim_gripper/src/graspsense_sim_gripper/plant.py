"""The gripper and what it squeezes: one degree of freedom, the motor angle, with a true stuck state.

The balance on the gap p is that of a geared pair of fingers,

    m(p) p'' + 1/2 m'(p) p'^2 = -F + (N_l + N_r)/2 - friction - b p',

with m(p) = (2 pi / (dp/dMR))^2 J, the rotor's inertia J seen through the transmission. It is integrated in the
motor angle, where the inertia is constant and the m' term is none; 73 to 123 kg on the gap of a PR2, beside which
the fingers' own 0.2 kg vanish. Friction is Coulomb, Stribeck and a part that grows with the load on the screw;
below breakaway nothing moves at all.

A tick is cut into steps. Their length follows from the error that each makes, by its own estimate, and is cut short
at an event: contact, stop, reversal, the slip of what was stuck. Two schemes of second order take them. A kick, a
drift and a kick (velocity Verlet) is explicit and needs the object's force once. Where dampers make the motion stiff
TR-BDF2 does, which is L-stable (Bank et al., IEEE Trans. Electron Devices 32, 1985; the error estimate is that of
Hosea and Shampine, Appl. Numer. Math. 20, 1996). What swings and is hardly damped is moved by the mean of the force
along the way of the step, so that what the speed gains is the work done (a discrete gradient: McLachlan, Quispel and
Robidoux, Phil. Trans. R. Soc. A 357, 1999; the mean is Simpson's, exact for a force that goes with the third power).

The object is free on a table, its mass negligible beside m: a finger that touches first pushes it, with the
table's friction on that pad, until both touch. Or it is held fast, and each finger presses its own half.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import ScrewLinkage, gap_and_rate
from graspsense_sim_gripper.dynamics.state import Contact, ContactState, Motion, PlantState, StepState
from graspsense_sim_gripper.terms.relaxation import late_share, mean_share

MOST_STEPS: Final = 20_000
"""A tick is cut into at most so many steps; what is then left of it is taken whole, and the state says so."""
MOST_HALVINGS: Final = 4
LEAST_TOLERANCE: Final = 1e-8
"""No halving asks for less: the error of a step is then rounding, which shorter steps make worse."""
SHORTEST_S: Final = 1e-10
SEARCH: Final = 100
"""Most steps of a search for where forces balance."""
FORCE_ROUNDING_N: Final = 1e-9
FORCE_ROUNDING: Final = 1e-11
"""A search ends where forces balance to this, absolute and relative."""
LENGTH_ROUNDING: Final = 1e-14
"""And to this share of what the covers would bear if the object gave way nowhere: what two lengths leave of it."""
LONG_S: Final = 10.0
"""Steps longer than this are as long as one likes."""
TOUCH_S: Final = 0.01
"""The first step after a touch, for a tolerance of 1."""
LEAST_TOUCH_S: Final = 1e-8
"""And at the least: over less than this the rate of a compression is mostly rounding, which a damper makes force of."""
CUBE: Final = -1.0 / 3.0
ROUNDING: Final = 4e-16
SPEED_ROUNDING: Final = 1e-11
IN_SHAPE_M: Final = 1e-12
"""Less than this of a compression is none: rounding of the search that found it."""
SHAPE_SCALE_M: Final = 1e-3
"""Below this a change of an object's shape that nobody feels counts as if it were this."""
LAG_PIECES: Final = 4
MOST_LAG_PIECES: Final = 1000
"""Where the drive lags, its effort is taken in so many pieces a time constant, each at its mean."""
SPEED_SCALE_M_S: Final = 1e-3
FORCE_SCALE_N: Final = 1.0
"""Below these an error counts as if the speed or the force were this."""
SMALL_FALL: Final = 0.05
"""Changes of an exponent up to this are four terms of a series, to 3e-7 of a newton."""
STANDING_M_S: Final = 1e-8
"""What is slower than this and slowing down stands."""
TOUCHING_M: Final = 1e-10
"""A contact is located to this."""
GAMMA: Final = 2.0 - math.sqrt(2.0)
"""Where TR-BDF2 goes from its trapezoid to its backward difference; both stages then weigh the rate alike."""
WEIGHT: Final = 1.0 - math.sqrt(0.5)
AHEAD: Final = 1.0 / (GAMMA * (2.0 - GAMMA))
BEHIND: Final = (1.0 - GAMMA) * (1.0 - GAMMA) / (GAMMA * (2.0 - GAMMA))
ESTIMATE: Final = 2.0 * (-3.0 * GAMMA * GAMMA + 4.0 * GAMMA - 2.0) / (12.0 * (2.0 - GAMMA))


EXPLICIT: Final = 0
STIFF: Final = 1
MEAN_FORCE: Final = 2
"""The schemes: velocity Verlet, TR-BDF2, and by the mean force of the step."""


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
    swings: int = 1
    """0: let go, it comes back to its shape and never beyond, so that it need not be watched meanwhile."""


class Steps(NamedTuple):
    """How a tick is cut into steps."""

    tolerance: float
    """Error of one step, as a share of force and speed, beyond which it is taken again, shorter."""
    scheme: int = EXPLICIT
    longest_s: float = math.inf
    settle: float = 0.0
    """Share of speed and force that halving the steps of a tick may change; 0: they are taken once."""
    growth: float = 2.0
    """By how much a step may be longer than the last, where something is touched: after a touch steps are as long as
    that was ago times this less one, however short they began."""


class PlantParams(NamedTuple):
    """The drive, the object, and how the motion is cut into steps."""

    drive: Drive
    thing: Thing
    steps: Steps


def _unbound(params: Any, states: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    raise TypeError("the plant has no terms: bind(squeeze, advance=sum_of(terms))")


advance: Callable[[Any, Any, float, float, float, float], tuple[float, Any]] = _unbound


def root_guess(x: float, miss: float, last: float, slope: float, least: float, most: float) -> float:
    """Return where to look next for the root of a function that rises through it: secant, kept between brackets.

    `least` and `most` are the nearest places known to lie below and above the root (or infinite).
    """
    ahead = x - miss / slope
    if least < ahead < most:
        return ahead
    if least > -math.inf and most < math.inf:
        return 0.5 * (least + most)
    # One side is not bracketed yet: go twice as far as last time.
    further = max(2.0 * abs(x - last), abs(miss / slope))
    return x - further if miss > 0.0 else x + further


def squeeze(thing: Thing, now: ContactState, closure_m: float, speed_m_s: float, h: float) -> ContactState:
    """Return the object after the fingers have come to `closure_m` (its width less the gap) within `h`.

    They then close at `speed_m_s`. The covers' compression and the object's add up to the closure and carry one
    force; a search finds the object's share, its rate by a backward difference of second order. Where that force
    would pull, the object and the covers spring back by themselves, free of force.
    """
    d0, force0, slope, states0, cover0, arm0, rate0, span = now
    skins = thing.skins_n_m
    terms = thing.terms
    rigid = skins == math.inf
    if rigid:
        skins = 0.0
    elif h <= 0.0:
        return now
    force, states, attempt = 0.0, states0, 0
    if rigid:
        # As nearly always it ends here, which a search below need not be gone into for.
        force, states = advance(terms, states0, d0, closure_m, h, speed_m_s)
        # A finger that is still behind where the object stood presses it only if that has not come back so far.
        if force >= 0.0 and (force <= 0.0 or force0 > 0.0 or closure_m >= d0):
            return ContactState(closure_m, force, slope, states, cover0, arm0, rate0, math.inf)
        if h <= 0.0:
            return now
        attempt = 1
    # Free until now, it is met where it stands; pressed until now, it is let go where its force would pull.
    touching = force0 > 0.0 and skins > 0.0
    over, base = h, d0
    if touching:
        ahead = h / (h + span)
        over = h / (1.0 + ahead)
        base += over * ahead * rate0
    # The covers' force is `push` less `stiff` times the object's compression.
    stiff, push, free_cover, kept = skins, skins * closure_m, 0.0, 1.0
    creeps = skins > 0.0 and (thing.skin.damping_n_s_m > 0.0 or thing.skin.arm_n_m > 0.0)
    even = late = 0.0
    if creeps:
        damping, arm_n_m, tau_s = thing.skin
        x = h / tau_s
        kept = math.exp(-x)
        late = arm_n_m * late_share(x, kept)
        even = arm_n_m * mean_share(x, kept) - late
        at_once = damping + late * h
        stiff += even + at_once / over
        push += arm0 * kept + even * (closure_m - cover0) + at_once * (speed_m_s + base / over)
        # With nothing pressing on it: a backward difference, for nobody feels it.
        free_cover = ((even + at_once / h) * cover0 - arm0 * kept) / (skins + even + at_once / h)
    k, c = (stiff, push) if touching else (0.0, 0.0)
    total = max(k + slope, 1e-3 * k, 1e-9)
    if rigid:
        total = _let_go(slope, force, force0, d0, closure_m)
    d1 = d0 + (c - k * d0 - force0) / total
    least, most, last = -math.inf, math.inf, d0
    force1 = 0.0
    look = 0
    rigid = met = False
    # One search, pressed or free, with the laws called in one place: what is called in more is compiled again.
    while True:
        force, states = advance(terms, states0, d0, d1, h, speed_m_s if rigid else (d1 - base) / over)
        if rigid:
            if force >= 0.0:
                return ContactState(d1, force, slope, states, cover0, arm0, rate0, math.inf)
            rigid, attempt = False, 1
            total = _let_go(slope, force, force0, d0, closure_m)
            d1 = d0 - force0 / total
            continue
        miss = force - (c - k * d1)
        # Over less than this the difference of two forces is mostly rounding.
        if look > 0 and abs(force - force1) > 1e-12 * abs(force) and d1 != last:
            slope = max((force - force1) / (d1 - last), 0.0)
            total = max(k + slope, 1e-3 * k, 1e-9)
        look += 1
        balanced = FORCE_ROUNDING_N + FORCE_ROUNDING * abs(force) + LENGTH_ROUNDING * abs(c)
        if look < SEARCH and abs(miss) > balanced:
            if miss > 0.0:
                most = d1
            else:
                least = d1
            d2 = root_guess(d1, miss, last, total, least, most)
            if d2 != d1 and most - least > 4e-16 * abs(d1):
                last, force1, d1 = d1, force, d2
                continue
        if touching and force >= 0.0:
            break
        if not touching and (attempt > 0 or skins == 0.0 or closure_m <= d1 + free_cover):
            if skins > 0.0 or met or closure_m <= d1:
                break
            rigid = met = True
            d1 = closure_m
            continue
        attempt += 1
        if attempt == 3:
            break
        touching = not touching
        k, c = (stiff, push) if touching else (0.0, 0.0)
        if not touching:
            over, base = h, d0
        total = max(k + slope, 1e-3 * k, 1e-9)
        d1 = d0 + (c - k * d0 - force0) / total
        least, most, last, look = -math.inf, math.inf, d0, 0
    rate = (d1 - d0) / h
    if not touching:
        arm = arm0 * kept + (even + late) * (free_cover - cover0)
        return ContactState(d1, 0.0, slope, states, free_cover, arm, rate, math.inf)
    span = h if force0 > 0.0 else math.inf
    if not creeps:
        return ContactState(d1, force, slope, states, cover0, arm0, rate, span)
    cover = closure_m - d1
    arm = arm0 * kept + even * (cover - cover0) + late * h * (speed_m_s - (d1 - base) / over)
    return ContactState(d1, force, slope, states, cover, arm, rate, span)


def _let_go(slope: float, force: float, force0: float, d0: float, closure_m: float) -> float:
    """Return the slope with which to look for where an object ends that rigid fingers at `closure_m` would pull."""
    total = max(slope, 1e-9)
    if d0 > closure_m:
        # No search has found a slope yet: from one too small it would begin nowhere near.
        total = max(total, (force0 - force) / (d0 - closure_m))
    return total


def rubbing(drive: Drive, velocity_m_s: float) -> tuple[float, float, float]:
    """Return by how much (N) friction is above Coulomb's at this speed of the gap, its slope, and how that bends.

    The slope is in N s/m, how it bends in N s2/m2.
    """
    more = drive.breakaway_n - drive.coulomb_n
    if more > 0.0:
        per_speed = 1.0 / drive.stribeck_m_s
        x = velocity_m_s * per_speed
        # Beyond that less than 2e-9 of it is left.
        if -4.5 < x < 4.5:
            more *= math.exp(-x * x)
            return more, -2.0 * x * per_speed * more, (4.0 * x * x - 2.0) * per_speed * per_speed * more
    return 0.0, 0.0, 0.0


def friction(drive: Drive, velocity_m_s: float, load_n: float) -> float:
    """Return the sliding friction (N, positive) at this speed of the gap and this mean pad force."""
    more, _, _ = rubbing(drive, velocity_m_s)
    return drive.coulomb_n + drive.load_share * load_n + more


def sliding_on(drive: Drive, more_n: float, before_m_s: float, after_m_s: float) -> float:
    """Return by how much friction is above Coulomb's at a speed, given (N) what that was at a speed near it.

    The same as of `rubbing`, by a series instead of another exponential.
    """
    if more_n <= 0.0:
        return 0.0
    per_speed = 1.0 / drive.stribeck_m_s
    fall = (before_m_s - after_m_s) * (before_m_s + after_m_s) * (per_speed * per_speed)
    if abs(fall) > SMALL_FALL:
        more, _, _ = rubbing(drive, after_m_s)
        return more
    return more_n * (1.0 + fall * (1.0 + fall * (0.5 + fall / 6.0)))


def acceleration(
    drive: Drive, rate_m_rev: float, speed_rev_s: float, net_n: float, resisting_n: float, direction: float
) -> float:
    """Return the motor's acceleration (rev/s2) under this net force on the gap, sliding in this direction."""
    damping = drive.damping_n_s_m * speed_rev_s * rate_m_rev
    # The same for all ticks, where a quotient would be waited for in each.
    per_inertia = 1.0 / drive.inertia
    return rate_m_rev * per_inertia * (net_n - direction * resisting_n - damping)


def move(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt` in which this effort was asked for (N, positive squeezes)."""
    lag = params.drive.lag_s
    if lag <= 0.0:
        pieces, h = 1, dt
    else:
        pieces = min(max(math.ceil(LAG_PIECES * dt / lag), 1), MOST_LAG_PIECES)
        h = dt / pieces
    given = effort_n
    for _ in range(pieces):
        if lag > 0.0:
            decay = math.exp(-h / lag)
            short = state.effort_n - effort_n
            given = effort_n + short * mean_share(h / lag, decay)
            motion, contact, step, _, peak = state
            state = PlantState(motion, contact, step, effort_n + short * decay, peak)
        state = _driven(params, state, given, h)
    return state


def _driven(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt` under a constant effort, taken once."""
    drive, thing, steps = params
    if state.contact.touched == 0 and state.motion.speed_rev_s == 0.0 and _blocked(drive, state, effort_n):
        return state
    if state.motion.speed_rev_s != 0.0 and steps.longest_s >= dt <= state.step.next_s:
        alike, after = _glide(drive, thing, steps, state, effort_n, dt)
        if alike:
            return after
    after, _ = _stepped(drive, thing, steps, state, effort_n, dt)
    return after


def _stepped(
    drive: Drive, thing: Thing, steps: Steps, state: PlantState, effort_n: float, dt: float
) -> tuple[PlantState, int]:
    """Return the plant after `dt` under a constant effort, and in how many steps."""
    left, count = dt, 0
    while True:
        h = min(state.step.next_s, steps.longest_s)
        must = count >= MOST_STEPS
        if must or left <= h * (1.0 + 1e-9):
            h = left
        elif left < 2.0 * h:
            h = 0.5 * left
        state, used = _step(drive, thing, steps, state, effort_n, h, left, must)
        left -= used
        count += 1
        if not (left > 1e-12 * dt and count <= MOST_STEPS):
            return state, count


def _settled(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the same, taken again in steps of half the length until its end stands still, where it is to settle.

    The state that the tick began with is then needed to its end, which costs compiled code a twentieth.
    """
    drive, thing, steps = params
    if state.contact.touched == 0 and state.motion.speed_rev_s == 0.0 and _blocked(drive, state, effort_n):
        return state
    if state.motion.speed_rev_s != 0.0 and steps.longest_s >= dt <= state.step.next_s and steps.settle <= 0.0:
        alike, after = _glide(drive, thing, steps, state, effort_n, dt)
        if alike:
            return after
    start = before = state
    counted = halved = 0
    while True:
        state, count = _stepped(drive, thing, steps, start, effort_n, dt)
        if (
            steps.settle <= 0.0
            or halved == MOST_HALVINGS
            # Halved once more they would be too many, and too short to be of use.
            or 4 * count > MOST_STEPS
            or (state.contact.touched == 0 and state.motion.speed_rev_s == 0.0)
        ):
            return state
        # Where the first steps were cut at half the tick already, those of the next attempt are the same.
        if count > counted > 0:
            speed0 = before.motion.speed_rev_s * before.motion.jacobian_m_rev
            speed1 = state.motion.speed_rev_s * state.motion.jacobian_m_rev
            contact0, contact1 = before.contact, state.contact
            force0, force1 = contact0.left_n + contact0.right_n, contact1.left_n + contact1.right_n
            # What is let go has no force that tells of it until it strikes the fingers again.
            shape0, shape1 = contact0.left.compression_m, contact1.left.compression_m
            other0, other1 = contact0.right.compression_m, contact1.right.compression_m
            if (
                abs(speed1 - speed0) <= steps.settle * max(abs(speed1), SPEED_SCALE_M_S)
                and abs(force1 - force0) <= steps.settle * max(force1, FORCE_SCALE_N)
                and abs(shape1 - shape0) <= steps.settle * max(abs(shape1), SHAPE_SCALE_M)
                and abs(other1 - other0) <= steps.settle * max(abs(other1), SHAPE_SCALE_M)
            ):
                return state
        # The error of a step goes with the third power of its length; one that the end of the tick cut is halved, too.
        steps = Steps(
            max(0.125 * steps.tolerance, min(steps.tolerance, LEAST_TOLERANCE)),
            steps.scheme,
            0.5 * min(steps.longest_s, dt),
            steps.settle,
            1.0 + 0.5 * (steps.growth - 1.0),
        )
        before, counted, halved = state, count, halved + 1


def _glide(
    drive: Drive, thing: Thing, steps: Steps, state: PlantState, effort_n: float, h: float
) -> tuple[bool, PlantState]:
    """Return whether `h` of motion is without an event and presses nothing, as in most ticks, and the plant after it.

    Nothing is touched, or one finger pushes the object before it, or what was let go comes back to its shape, of which
    nobody feels anything. As by a kick, a drift and a kick, but for the third order: of the second kick only the slopes
    are taken, of friction and damper over the speed and of the linkage's ratio over the way, so that a tick waits for
    friction and linkage once, and for neither behind the other.
    """
    (revolutions, speed, gap, rate), contact, (step, n, lost), given, peak = state
    left, right, offset, touched, squeezed, other, alone = contact
    direction = 1.0 if speed > 0.0 else -1.0
    load = 0.5 * (left + right)
    reach = thing.width_m + 2.0 * abs(offset)
    if touched == 1:
        if load > 0.0:
            if squeezed.force_n > 0.0 or squeezed.compression_m != 0.0 or thing.held == 1 or direction > 0.0:
                return False, state
            reach = thing.width_m
        else:
            alone += h
            came = alone * max(abs(squeezed.rate_m_s), abs(other.rate_m_s))
            shape = max(abs(squeezed.compression_m), abs(other.compression_m), SHAPE_SCALE_M)
            if (
                gap <= reach
                or thing.swings == 1
                or thing.skin.damping_n_s_m > 0.0
                or thing.skin.arm_n_m > 0.0
                or came * came > 2.0 * steps.tolerance * shape * shape
            ):
                return False, state
    slides = speed * rate
    more, steeper, curved = rubbing(drive, slides)
    net = load - effort_n - direction * (drive.coulomb_n + drive.load_share * load + more)
    net -= drive.damping_n_s_m * slides
    per_inertia = 1.0 / drive.inertia
    kick = rate * per_inertia * net
    # Where it comes to at its speed; it ends a little beyond.
    gap1, rate1 = gap_and_rate(drive.link, revolutions + h * speed)
    bends = rate1 - rate
    resists = direction * steeper + drive.damping_n_s_m
    change = per_inertia * (bends * (net - resists * slides) - rate * rate * resists * (h * kick))
    # Where friction is greatest it has no slope, and yet changes.
    gained = h * kick * rate
    unseen = abs(rate) * per_inertia * 0.5 * abs(curved) * gained * gained
    gains = 0.5 * h * kick
    speed1 = speed + h * (kick + 0.5 * change)
    if (speed + h * kick) * direction <= 0.0 or abs(slides) < STANDING_M_S:
        return False, state
    revolutions1 = revolutions + h * (speed + gains)
    gap1 += h * gains * rate1
    rate1 += bends / speed * gains
    if (
        speed1 * direction <= 0.0
        or gap1 <= reach
        or not drive.closed_rev < revolutions1 < drive.open_rev
        or h * abs(rate) * (abs(change) + unseen) > steps.tolerance * SPEED_SCALE_M_S
    ):
        return False, state
    if load > 0.0:
        # The finger takes the object along, towards the middle.
        pushed = 0.5 * (gap1 - reach)
        offset = pushed if offset >= 0.0 else -pushed
    return True, PlantState(
        Motion(revolutions1, speed1, gap1, rate1),
        Contact(left, right, offset, touched, squeezed, other, alone),
        StepState(step, n + 1, lost),
        given,
        peak,
    )


def _step(
    drive: Drive,
    thing: Thing,
    steps: Steps,
    state: PlantState,
    effort_n: float,
    h: float,
    left_s: float,
    must: bool,
) -> tuple[PlantState, float]:
    """Return the plant after one step of `h` without an event inside, and how long it took.

    What stands still does so for the longest step, as a rule all that is left of the tick. `must`: whatever its error.
    A step whose error is too large takes no time, and leaves the state as it was with a shorter step to try.
    """
    (revolutions, speed, gap, rate), contact, (step, n, lost), given, peak = state
    left, right, offset, touched, squeezed, other, alone = contact
    load = 0.5 * (left + right)
    net = load - effort_n
    used = h

    if speed == 0.0:
        resisting = drive.breakaway_n + drive.load_share * load
        if _blocked(drive, state, effort_n):
            if touched == 0:
                return state, left_s
            return _stuck(drive, thing, state, effort_n, left_s if must else min(left_s, steps.longest_s))
        direction = 1.0 if net > 0.0 else -1.0
    else:
        direction = 1.0 if speed > 0.0 else -1.0
        resisting = friction(drive, speed * rate, load)
    kick = acceleration(drive, rate, speed, net, resisting, direction)
    slowing = kick * direction < 0.0
    # What stands goes on from there in the next step, if at all.
    done = slowing and abs(speed * rate) < STANDING_M_S
    again = 0.0
    # The gap at which a finger touches, or once one does, the second.
    reach = thing.width_m + 2.0 * abs(offset)
    meeting = reach if gap > reach else thing.width_m - (2.0 * abs(offset) if thing.held == 1 else 0.0)
    end = drive.open_rev if direction > 0.0 else drive.closed_rev

    shift = grip = 0.0
    revolutions1, speed1, gap1, rate1 = revolutions, 0.0, gap, rate
    left1, right1, offset1, squeezed1, other1 = left, right, offset, squeezed, other
    load1 = load
    if done:
        used = 0.0
    elif steps.scheme != EXPLICIT:
        revolutions1, speed1, gap1, rate1, shift, grip, left1, right1, offset1, squeezed1, other1 = _implicit(
            drive, thing, state, effort_n, kick, direction, h, steps.scheme == MEAN_FORCE
        )
        load1 = 0.5 * (left1 + right1)
        short = 0.0
        if gap > meeting and gap1 < meeting - TOUCHING_M:
            short = (gap - meeting) / (gap - gap1)
        elif (revolutions1 - end) * direction * abs(rate) > TOUCHING_M:
            short = (end - revolutions) / (revolutions1 - revolutions)
        elif speed1 * direction < 0.0 and speed != 0.0 and abs(speed1 * rate1) >= STANDING_M_S:
            short = abs(speed) / (abs(speed) + abs(speed1))
        elif load > 0.0 and load1 == 0.0 and gap1 > gap:
            # Let go on the way: beyond where the object then ends nothing drives the fingers.
            beyond = gap1 - (thing.width_m - squeezed1.compression_m - squeezed1.pad_m)
            if beyond > TOUCHING_M:
                short = max(1.0 - beyond / (gap1 - gap), 0.01)
        if short > 0.0 and h > SHORTEST_S and not must:
            again = h * min(max(short, 0.01), 0.99)
    else:
        if slowing and (speed + kick * h) * direction <= 0.0:
            used = -speed / kick
        revolutions1 = revolutions + used * (speed + 0.5 * kick * used)
        gap1, rate1 = gap_and_rate(drive.link, revolutions1)
        if gap > meeting > gap1:
            used = used * (gap - meeting) / (gap - gap1)
            for _ in range(4):
                revolutions1 = revolutions + used * (speed + 0.5 * kick * used)
                gap1, rate1 = gap_and_rate(drive.link, revolutions1)
                off = (gap1 - meeting) / (rate1 * (speed + kick * used))
                if not 0.0 < used - off <= h:
                    break
                used -= off
            gap1 = min(gap1, meeting)
        if (revolutions1 - end) * direction > 0.0:
            # What is pressed there is pressed as far as the travel goes, and no further.
            used = min(max(used * (end - revolutions) / (revolutions1 - revolutions), 0.0), used)
            revolutions1 = end
            gap1, rate1 = gap_and_rate(drive.link, end)
        speed1 = speed + kick * used
        if touched == 1 or gap1 <= reach:
            # What touches now has been touched for no time, but a rigid cover feels its damper at once.
            since = used + alone if touched == 1 else 0.0
            left1, right1, offset1, squeezed1, other1 = _felt(
                thing, left, right, offset, squeezed, other, gap1, -speed1 * rate1, since, False
            )
            load1 = 0.5 * (left1 + right1)
        resisting = friction(drive, speed1 * rate1, load1)
        kick1 = acceleration(drive, rate1, speed1, load1 - effort_n, resisting, direction)
        if touched == 0 and gap1 <= reach:
            # The force that meets it there is of the next step.
            kick1 = kick
        speed1 = speed + 0.5 * used * (kick + kick1)
        if steps.tolerance < math.inf:
            change = kick1 - kick
            # A difference of forces that is rounding says nothing of the step.
            noise = ROUNDING * max(
                squeezed1.slope_n_m * abs(squeezed1.compression_m),
                other1.slope_n_m * abs(other1.compression_m),
            )
            noise += 4.0 * (FORCE_ROUNDING_N + FORCE_ROUNDING * max(load, load1))
            if abs(change) * drive.inertia <= noise * abs(rate):
                change = 0.0
            # Where so little changes the errors below are smaller still, as in most ticks.
            if touched == 1 or abs(used * change * rate) > steps.tolerance * SPEED_SCALE_M_S:
                most = max(abs(kick), abs(kick1))
                if most > 0.0:
                    shift = abs(used * change * change / (12.0 * most) * rate)
                fastest = max(abs(speed), abs(speed1))
                if fastest > 0.0:
                    grip = abs((load1 - load) * used * change / (6.0 * fastest))

    if not done and again == 0.0:
        if speed1 * direction <= 0.0:
            speed1 = 0.0
        growth = 4.0 if touched == 0 else steps.growth
        if steps.tolerance == math.inf:
            step = math.inf
        elif not shift + grip <= 0.0:
            error = (
                max(
                    shift / max(abs(speed * rate), abs(speed1 * rate1), SPEED_SCALE_M_S),
                    grip / max(load, load1, FORCE_SCALE_N),
                )
                / steps.tolerance
            )
            allowed = used * max(0.9 * error**CUBE, 0.2) if error > 1e-3 else 9.0 * used
            good = min(allowed, growth * used)
            if error <= 1.0:
                # An event or the end of the tick may have made it short, not its error.
                step = good if used >= step else max(good, step, min(allowed, growth * step))
            elif used > SHORTEST_S and not must:
                again = good if 1.0 < error < math.inf else 0.2 * used
            else:
                lost += 1
        elif step < math.inf:
            step = growth * max(step, used) if step < LONG_S else math.inf
    if again > 0.0:
        return PlantState(state.motion, contact, StepState(again, n, lost), given, peak), 0.0
    if gap > meeting >= gap1 and steps.tolerance < math.inf:
        # A damper of cover or object begins to relax here, which only short steps see.
        step = min(step, max(TOUCH_S * steps.tolerance, LEAST_TOUCH_S))
    if touched == 1 or gap1 <= reach:
        # Let go and in shape again: as before the first contact.
        shape = abs(squeezed1.compression_m) + abs(squeezed1.pad_m) + abs(other1.compression_m)
        touched = 0 if gap1 > reach and left1 + right1 == 0.0 and shape <= IN_SHAPE_M else 1
        peak = max(peak, squeezed1.force_n, other1.force_n)
    if revolutions1 >= drive.open_rev and speed1 >= 0.0:
        revolutions1, speed1 = drive.open_rev, 0.0
        gap1, rate1 = gap_and_rate(drive.link, revolutions1)
    elif revolutions1 <= drive.closed_rev and speed1 <= 0.0:
        revolutions1, speed1 = drive.closed_rev, 0.0
        gap1, rate1 = gap_and_rate(drive.link, revolutions1)
    return PlantState(
        Motion(revolutions1, speed1, gap1, rate1),
        Contact(left1, right1, offset1, touched, squeezed1, other1, alone if done else 0.0),
        StepState(step, n + 1, lost),
        given,
        peak,
    ), used


def _blocked(drive: Drive, state: PlantState, effort_n: float) -> bool:
    """Return whether fingers that stand do not begin to move: for friction, or at an end of their travel."""
    load = 0.5 * (state.contact.left_n + state.contact.right_n)
    net = load - effort_n
    return (
        abs(net) <= drive.breakaway_n + drive.load_share * load
        or (net > 0.0 and state.motion.revolutions >= drive.open_rev)
        or (net < 0.0 and state.motion.revolutions <= drive.closed_rev)
    )


def _stuck(
    drive: Drive, thing: Thing, state: PlantState, effort_n: float, h: float
) -> tuple[PlantState, float]:
    """Return the plant after the fingers have stood still for `h`, or until they begin to slip."""
    (revolutions, _, gap, rate), contact, step, given, peak = state
    left, right, offset, touched, squeezed, other, alone = contact
    load = 0.5 * (left + right)
    spare = drive.breakaway_n + drive.load_share * load - abs(load - effort_n)
    used = h
    for _ in range(6):
        left1, right1, offset1, squeezed1, other1 = _felt(
            thing, left, right, offset, squeezed, other, gap, 0.0, used + alone, True
        )
        load1 = 0.5 * (left1 + right1)
        spare1 = drive.breakaway_n + drive.load_share * load1 - abs(load1 - effort_n)
        if spare1 >= -1e-6 or spare < 1e-9 or used < 1e-6 * h:
            break
        used = max(used * (spare + 5e-7) / (spare - spare1), min(used, SHORTEST_S))
    peak = max(peak, squeezed1.force_n, other1.force_n)
    return PlantState(
        Motion(revolutions, 0.0, gap, rate),
        Contact(left1, right1, offset1, touched, squeezed1, other1, 0.0),
        step,
        given,
        peak,
    ), used


def _implicit(
    drive: Drive,
    thing: Thing,
    state: PlantState,
    effort_n: float,
    kick: float,
    direction: float,
    h: float,
    by_mean: bool,
) -> tuple[float, float, float, float, float, float, float, float, float, ContactState, ContactState]:
    """Take one step of TR-BDF2, or `by_mean` of the force along the step.

    Return angle, speed, gap and its rate, the errors of the speed (m/s) and of the force (N), and what `_felt` does.
    """
    revolutions, speed, _, rate = state.motion
    left, right, offset, touched, squeezed, other, alone = state.contact
    part, over = GAMMA * h, WEIGHT * h
    scale = max(abs(speed), 1e-3 * SPEED_SCALE_M_S / abs(rate))
    # The trapezoid, then the backward difference over the same weight of the rate.
    from_rev, from_speed = revolutions + over * speed, speed + over * kick
    stages, pieces = 2, 1
    if by_mean:
        # In one: to the middle of the way and on to its end, at the mean speed, by Simpson's mean of the rates.
        stages, pieces, part = 1, 2, 0.5 * h
    guess = speed + pieces * part * kick
    middle_rev, middle_speed, middle_kick = revolutions, speed, kick
    for stage in range(stages):
        least, most = -math.inf, math.inf
        x0, miss0, slope = guess, 0.0, 1.0
        x = guess
        for look in range(SEARCH):
            left1, right1, offset1, squeezed1, other1 = left, right, offset, squeezed, other
            since, v, kick1 = part + alone, x, kick
            for piece in range(pieces):
                if by_mean:
                    middle_kick = kick1
                    way = 0.5 * (piece + 1)
                    v = speed + way * (x - speed)
                    revolutions1 = revolutions + way * h * 0.5 * (speed + x)
                else:
                    revolutions1 = from_rev + over * x
                gap1, rate1 = gap_and_rate(drive.link, revolutions1)
                if touched == 1:
                    left1, right1, offset1, squeezed1, other1 = _felt(
                        thing, left1, right1, offset1, squeezed1, other1, gap1, -v * rate1, since, False
                    )
                load1 = 0.5 * (left1 + right1)
                resisting = friction(drive, v * rate1, load1)
                kick1 = (
                    rate1
                    / drive.inertia
                    * (load1 - effort_n - direction * resisting - drive.damping_n_s_m * v * rate1)
                )
                since = part
            if by_mean:
                over = h / 6.0
                from_speed = speed + over * (kick + 4.0 * middle_kick)
            miss = x - from_speed - over * kick1
            if look > 0 and abs(x - x0) > 1e-14 * scale:
                slope = max((miss - miss0) / (x - x0), 0.1)
            if abs(miss) <= SPEED_ROUNDING * scale * slope:
                break
            if miss > 0.0:
                most = x
            else:
                least = x
            ahead = (
                x - math.copysign(1e-5 * scale, miss)
                if look == 0
                else root_guess(x, miss, x0, slope, least, most)
            )
            if ahead == x:
                break
            x0, miss0, x = x, miss, ahead
        if stage + 1 < stages:
            middle_rev, middle_speed, middle_kick = revolutions1, x, kick1
            left, right, offset, squeezed, other = left1, right1, offset1, squeezed1, other1
            from_rev = AHEAD * middle_rev - BEHIND * revolutions
            from_speed = AHEAD * middle_speed - BEHIND * speed
            guess = x + (1.0 - GAMMA) * h * kick1
            part, alone = (1.0 - GAMMA) * h, 0.0
    if by_mean:
        # As of a trapezoid: the rate is taken where it is at half the way, not at half the time.
        most = max(abs(kick), abs(kick1), 1e-300)
        moved = h * h * (kick1 - kick) / 12.0
        error = h * (kick1 - kick) * (kick1 - kick) / (12.0 * most)
    else:
        # The difference to a third-order solution, as the stages' own operator damps it.
        early, mid, late = 1.0 / GAMMA, 1.0 / (GAMMA * (1.0 - GAMMA)), 1.0 / (1.0 - GAMMA)
        error = ESTIMATE * h * (early * kick - mid * middle_kick + late * kick1) / slope
        moved = ESTIMATE * h * (early * speed - mid * middle_speed + late * x) / slope
    way = abs(revolutions1 - revolutions)
    before = 0.5 * (state.contact.left_n + state.contact.right_n)
    grip = abs(load1 - before) * abs(moved) / way if way > 0.0 else 0.0
    return (
        revolutions1,
        x,
        gap1,
        rate1,
        abs(error * rate),
        grip,
        left1,
        right1,
        offset1,
        squeezed1,
        other1,
    )


def _felt(
    thing: Thing,
    left_n: float,
    right_n: float,
    offset_m: float,
    squeezed: ContactState,
    other: ContactState,
    gap_m: float,
    speed_m_s: float,
    h: float,
    still: bool,
) -> tuple[float, float, float, ContactState, ContactState]:
    """Return the forces on the pads at this gap, reached in `h` and closing at this speed, and the object then.

    Given are the forces, the offset and the object before; `still`: the fingers did not move.
    """
    closure = thing.width_m - gap_m
    offset = offset_m
    left = right = 0.0
    # A pad that alone holds the object against the table goes on doing so.
    against_left = min(left_n, thing.table_n) if left_n > right_n else 0.0
    against_right = min(right_n, thing.table_n) if right_n > left_n else 0.0
    if still:
        left, right = against_left, against_right
    elif thing.held == 0 and -closure <= 2.0 * abs(offset):
        pushed = 0.5 * max(-closure, 0.0)
        if pushed < abs(offset):
            right = thing.table_n if offset > 0.0 else 0.0
            left = thing.table_n - right
        elif closure > 0.0:
            left, right = against_left, against_right
        offset = pushed if offset >= 0.0 else -pushed
    # Held fast, each finger presses its own half as if the other did the same; free, both press the whole.
    shift = 2.0 * offset if thing.held == 1 else 0.0
    for half in range(1 + thing.held):
        one = squeezed if half == 0 else other
        shut = closure - shift if half == 0 else closure + shift
        if still or shut >= 0.0 or one.compression_m != 0.0:
            since = h
            if 0.0 <= shut <= TOUCHING_M and one.compression_m == 0.0 and shut < h * speed_m_s:
                # Met only just, with the object pushed before: a cover's damper has worked since then and no longer.
                since = shut / speed_m_s
            one = squeeze(thing, one, shut, speed_m_s, since)
        if half == 0:
            squeezed = one
        else:
            other = one
    if thing.held == 1:
        return squeezed.force_n, other.force_n, offset, squeezed, other
    force = squeezed.force_n
    return max(force, left), max(force, right), offset, squeezed, other
