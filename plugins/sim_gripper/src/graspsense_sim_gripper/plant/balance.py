"""The balance of forces: two compliant pads in series with the object carry one force.

The pads' compression and the object's add up to the closure (the object's width less the gap). The object's mass is
negligible beside the drive's inertia, so this balance is algebraic; `solve_contact` solves it by a bracketed secant
search. The rate of the compression, which dampers of the object need, is a backward difference with variable steps: of
third order (BDF3), of second where a step is more than `MAX_GROWTH` times the one before, and of first where there is
no step before.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from graspsense_sim_gripper.plant.object_model import ObjectModel, object_force
from graspsense_sim_gripper.plant.pads import (
    ARGUMENT_RTOL,
    MAX_ITERATIONS,
    NO_CREEP,
    creep_over,
    pad_excess,
)
from graspsense_sim_gripper.plant.state import ContactState, Past, without_past

BALANCE_SCALE_N: Final = 100.0
"""The tolerance is relative to the force and to this one together, so that it has an absolute part."""
LENGTH_RTOL: Final = 1e-14
"""Additional tolerance for the rounding of lengths, relative to the force of the pads against a rigid object."""
SECANT_ITERATIONS: Final = 20
"""From here on a bracketed search bisects: the secant gains little where a law has a corner or an infinite slope."""
FIRST_REACH_M: Final = 1e-3
REACH_FACTOR: Final = 4.0
"""Without a bracket the search goes no further from its start than this multiple of the last distance, or than the
first value. Where the slope is not known yet a secant would go kilometres away, where no law holds."""
UNBALANCED_RTOL: Final = 1e-6
"""A search that ends with forces further apart than this, relative to the force or to 1 N, has not converged."""
MIN_SLOPE_N_M: Final = 1e-9
MIN_SLOPE_SHARE: Final = 1e-3
"""The least slope of the balance with which a secant step is taken, absolute and relative to the pads' stiffness."""
MAX_GROWTH: Final = 1.5
"""Largest ratio of two steps with which the rate is of third order: BDF3 is stable up to 1.534 (Calvo, Grande and
Grigorieff 1990)."""
EQUAL_GUESSES: Final = 10.0
"""Multiple of the tolerance of the balance by which two guesses of the compression may differ and count as equal."""


class PadLoad(NamedTuple):
    """The pads' force as a linear function of the object's compression d: `push_n - stiffness_n_m * d`."""

    stiffness_n_m: float
    push_n: float
    base_m: float
    span_s: float
    """The rate of the compression is (d - base_m) / span_s."""
    closure_m: float
    """Compression of pads and object together; -inf where they are separated."""


class BalanceSearch(NamedTuple):
    """The state of a secant search for the object's compression."""

    compression_m: float
    last_m: float
    last_n: float
    """Force of the object at `last_m`."""
    slope_n_m: float
    """Stiffness of the object by the secant."""
    total_n_m: float
    """Stiffness of the balance: of the object and the pads."""
    lower_m: float
    upper_m: float
    n: int


def solve_contact(
    model: ObjectModel, now: ContactState, closure_m: float, speed_m_s: float, h: float
) -> tuple[ContactState, int]:
    """Return the object after the fingers have come to `closure_m` within `h`, closing at `speed_m_s` at the end.

    Where the force would be tensile, object and pads are separated and recover freely. The second value is 1 if the
    search for the balance of forces has not converged.
    """
    if model.pads.stiffness_n_m < math.inf:
        return _press_through_pads(model, now, closure_m, speed_m_s, h) if h > 0.0 else (now, 0)
    d0, force0, slope, states0, _, _, _ = now
    force, states = object_force(model.terms, states0, d0, closure_m, h, speed_m_s)
    # A finger that is still behind where the object stood presses it only if the object has not recovered so far.
    if force >= 0.0 and (force <= 0.0 or force0 > 0.0 or closure_m >= d0):
        return _on_rigid_pads(now, closure_m, force, slope, states), 0
    return _release_from_rigid_pads(model, now, force, closure_m, speed_m_s, h) if h > 0.0 else (now, 0)


def _on_rigid_pads(
    now: ContactState, compression_m: float, force_n: float, slope_n_m: float, states: Any
) -> ContactState:
    """Return the object that rigid pads press to this compression."""
    return ContactState(
        compression_m=compression_m,
        force_n=force_n,
        slope_n_m=slope_n_m,
        states=states,
        pad_m=now.pad_m,
        branch_n=now.branch_n,
        past=without_past(now.past.rate_m_s),
    )


def _release_from_rigid_pads(
    model: ObjectModel, now: ContactState, force_n: float, closure_m: float, speed_m_s: float, h: float
) -> tuple[ContactState, int]:
    """Return the object that rigid pads at `closure_m` would pull with `force_n`: separated, or pressed after all."""
    d0, force0, slope, states0, _, branch0, _ = now
    load = PadLoad(stiffness_n_m=0.0, push_n=0.0, base_m=d0, span_s=h, closure_m=-math.inf)
    total = _release_slope(slope, force_n, force0, d0, closure_m)
    search = _search_from(d0 + (0.0 - force0) / total, d0, slope, total)
    search, force, states = _balance(model, now, load, search, h)
    if closure_m > search.compression_m:
        # Free, it would have ended behind the pads: they press it where they are.
        force, states = object_force(model.terms, states0, d0, closure_m, h, speed_m_s)
        if force >= 0.0:
            return _on_rigid_pads(now, closure_m, force, search.slope_n_m, states), 0
        total = _release_slope(search.slope_n_m, force, force0, d0, closure_m)
        _, last, last_n, slope, _, lower, upper, n = search
        search = BalanceSearch(
            compression_m=d0 - force0 / total,
            last_m=last,
            last_n=last_n,
            slope_n_m=slope,
            total_n_m=total,
            lower_m=lower,
            upper_m=upper,
            n=n,
        )
        search, force, states = _balance(model, now, load, search, h)
    d1 = search.compression_m
    free = ContactState(
        compression_m=d1,
        # No force, but NaN where a law gave no finite one, so that it is noticed.
        force_n=force - force,
        slope_n_m=search.slope_n_m,
        states=states,
        pad_m=0.0,
        branch_n=branch0,
        past=without_past((d1 - d0) / h),
    )
    return free, _unbalanced(force, 0.0, 0.0)


def _unbalanced(force_n: float, pads_n: float, push_n: float) -> int:
    """Return 1 if the force of the object is not that of the pads, or not finite.

    `push_n`: that of `PadLoad`, whose rounding the search does not see.
    """
    miss_n = abs(force_n - pads_n)
    most_n = UNBALANCED_RTOL * max(abs(force_n), 1.0) + LENGTH_RTOL * abs(push_n)
    return 0 if miss_n < math.inf and miss_n <= most_n else 1


def _release_slope(slope: float, force: float, force0: float, d0: float, closure_m: float) -> float:
    """Return the slope with which the search for the end of a separated object begins."""
    total = max(slope, MIN_SLOPE_N_M)
    if d0 > closure_m:
        # No search has met a slope yet. One that is too small would begin far from the end.
        total = max(total, (force0 - force) / (d0 - closure_m))
    return total


def _press_through_pads(
    model: ObjectModel, now: ContactState, closure_m: float, speed_m_s: float, h: float
) -> tuple[ContactState, int]:
    """Return the object behind compliant pads: pressed or separated, whichever of the two is consistent."""
    pads = model.pads
    d0, force0, slope, _, pad0, branch0, (rate0, change0, span, _) = now
    pressed = force0 > 0.0
    over, base = _backward_difference(now, h) if pressed else (h, d0)
    stiffness, push, creep = pads.stiffness_n_m, pads.stiffness_n_m * closure_m, NO_CREEP
    creeps = pads.damping_n_s_m > 0.0 or pads.branch_n_m > 0.0
    if creeps:
        creep = creep_over(pads, now, h)
        decay, mean, _, damper, _ = creep
        stiffness += mean + damper / over
        push += branch0 * decay + mean * (closure_m - pad0) + damper * (speed_m_s + base / over)
    n_changes = 0
    while True:
        k, c, closed = (stiffness, push, closure_m) if pressed else (0.0, 0.0, -math.inf)
        excess, excess_slope = pad_excess(pads, closed - d0)
        total = max(k + slope + excess_slope, MIN_SLOPE_SHARE * k, MIN_SLOPE_N_M)
        d1 = d0 + (c - k * d0 + excess - force0) / total
        if pressed and span < math.inf:
            # Usually closer than the linearized balance, which knows nothing of what relaxes meanwhile. Where the two
            # are this close, nothing does, and the extrapolation has the rounding of three searches.
            further = d0 + h * (rate0 + 0.5 * (h + span) * change0)
            if total * abs(further - d1) > EQUAL_GUESSES * balance_tolerance(model, force0):
                d1 = further
        search = _search_from(d1, d0, slope, total)
        load = PadLoad(stiffness_n_m=k, push_n=c, base_m=base, span_s=over, closure_m=closed)
        search, force, states = _balance(model, now, load, search, h)
        d1, slope = search.compression_m, search.slope_n_m
        # NaN ends the search too.
        if not force < 0.0 if pressed else n_changes > 0 or closure_m <= d1 + creep.free_pad_m:
            break
        pressed, n_changes = not pressed, n_changes + 1
        over, base = h, d0
    excess, _ = pad_excess(pads, closed - d1)
    rate, unbalanced = (d1 - d0) / h, _unbalanced(force, c - k * d1 + excess, c)
    pad, branch, past = pad0, branch0, without_past(rate)
    if not pressed:
        force = force - force
        pad = creep.free_pad_m
        branch = branch0 * creep.decay + (creep.mean_n_m + creep.ramp_n_m) * (pad - pad0)
    else:
        if not force0 <= 0.0:
            past = Past(rate, 0.0 if span == math.inf else 2.0 * (rate - rate0) / (h + span), h, span)
        if creeps:
            pad = closure_m - d1
            branch = branch0 * creep.decay + creep.mean_n_m * (pad - pad0)
            branch += creep.ramp_n_m * h * (speed_m_s - (d1 - base) / over)
    pressed_or_free = ContactState(
        compression_m=d1,
        force_n=force,
        slope_n_m=slope,
        states=states,
        pad_m=pad,
        branch_n=branch,
        past=past,
    )
    return pressed_or_free, unbalanced


def _backward_difference(now: ContactState, h: float) -> tuple[float, float]:
    """Return `span_s` and `base_m` of `PadLoad` after a step of `h`, for an object that was pressed before it."""
    d0, (rate0, change0, span, previous_span) = now.compression_m, now.past
    ahead = h / (h + span)
    over = h / (1.0 + ahead)
    base = d0 + over * ahead * rate0
    if h <= MAX_GROWTH * span and previous_span < math.inf:
        two_back = h / (h + span + previous_span)
        over = h / (1.0 + ahead + two_back)
        base = d0 + over * ((ahead + two_back) * rate0 + 0.5 * two_back * (h + span) * change0)
    return over, base


def balance_tolerance(model: ObjectModel, force_n: float) -> float:
    """Return how far (N) the forces of object and pads may be apart at this force."""
    return model.balance_rtol * (BALANCE_SCALE_N + abs(force_n))


def _search_from(compression_m: float, earlier_m: float, slope_n_m: float, total_n_m: float) -> BalanceSearch:
    """Return the beginning of a search at a compression, of an object that was compressed by `earlier_m` before."""
    return BalanceSearch(
        compression_m=compression_m,
        last_m=earlier_m,
        last_n=0.0,
        slope_n_m=slope_n_m,
        total_n_m=total_n_m,
        lower_m=-math.inf,
        upper_m=math.inf,
        n=0,
    )


def _balance(
    model: ObjectModel, now: ContactState, load: PadLoad, search: BalanceSearch, h: float
) -> tuple[BalanceSearch, float, Any]:
    """Search the compression at which the object bears the pads' force; return it with the force and terms' states."""
    d0, states0 = now.compression_m, now.states
    terms = model.terms
    k, c, base, over, closed = load
    d1, last, last_n, slope, total, lower, upper, n = search
    while True:
        force, states = object_force(terms, states0, d0, d1, h, (d1 - base) / over)
        excess, excess_slope = pad_excess(model.pads, closed - d1)
        miss = force - (c - k * d1) - excess
        # The difference of two forces that are closer than this is mostly rounding.
        if n > 0 and abs(force - last_n) > 1e-12 * abs(force) and d1 != last:
            slope = max((force - last_n) / (d1 - last), 0.0)
            total = max(k + slope + excess_slope, MIN_SLOPE_SHARE * k, MIN_SLOPE_N_M)
        n += 1
        tolerance = balance_tolerance(model, force) + LENGTH_RTOL * abs(c)
        if n >= MAX_ITERATIONS or not abs(miss) > tolerance:
            break
        if miss > 0.0:
            upper = d1
        else:
            lower = d1
        if lower == -math.inf or upper == math.inf:
            d2 = bracketed_secant(d1, miss, last, total, lower, upper)
            reach = max(FIRST_REACH_M, REACH_FACTOR * abs(d1 - d0))
            if abs(d2 - d1) > reach:
                d2 = d1 + reach if d2 > d1 else d1 - reach
        elif n > SECANT_ITERATIONS:
            d2 = 0.5 * (lower + upper)
        else:
            d2 = bracketed_secant(d1, miss, last, total, lower, upper)
        if d2 == d1 or not upper - lower > ARGUMENT_RTOL * abs(d1):
            break
        last, last_n, d1 = d1, force, d2
    search = BalanceSearch(
        compression_m=d1,
        last_m=last,
        last_n=last_n,
        slope_n_m=slope,
        total_n_m=total,
        lower_m=lower,
        upper_m=upper,
        n=n,
    )
    return search, force, states


def bracketed_secant(
    x: float, value: float, last_x: float, slope: float, lower: float, upper: float
) -> float:
    """Return the next argument: that of the secant, or that of bisection if the secant leaves the bracket.

    `lower` and `upper` are the nearest arguments known to lie below and above the root, or infinite. While one of them
    is infinite, a secant that leaves the bracket is replaced by a step of twice the last length.
    """
    secant = x - value / slope
    if lower < secant < upper:
        return secant
    if lower > -math.inf and upper < math.inf:
        return 0.5 * (lower + upper)
    length = max(2.0 * abs(x - last_x), abs(value / slope))
    return x - length if value > 0.0 else x + length
