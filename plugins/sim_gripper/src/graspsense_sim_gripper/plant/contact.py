"""The contact: two compliant pads in series with the object, and the object on its table.

The pads' compression and the object's add up to the closure (the object's width less the gap), and both carry one
force. The object's mass is negligible beside the drive's inertia, so this balance is algebraic; `solve_contact` solves
it by a bracketed secant search. The rate of the compression, which dampers of the object need, is a backward difference
with variable steps: of third order (BDF3), of second where a step is more than `MAX_GROWTH` times the one before, and
of first where there is no step before.

An object that is free stands on a table: the finger that touches first pushes it, against the friction of the table,
until both fingers touch. An object that is held fast stays where it is, and each finger presses its own half.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

from graspsense_sim_gripper.plant.roots import MAX_ITERATIONS, bracketed_secant
from graspsense_sim_gripper.plant.state import Contact, ContactState, Halves, Past, right_of
from graspsense_sim_gripper.scene.terms.phi import phi1, phi_ramp

BALANCE_RTOL: Final = 1e-11
"""The least relative tolerance of the balance of forces, which a reference has."""
BALANCE_SCALE_N: Final = 100.0
"""The tolerance is relative to the force and to this one together, so that it has an absolute part."""
LENGTH_RTOL: Final = 1e-14
"""Additional tolerance for the rounding of lengths, relative to the force of the pads against a rigid object."""
ARGUMENT_RTOL: Final = 4e-16
"""Relative width of a bracket below which it contains no further floating-point number."""
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
CONTACT_TOL_M: Final = 1e-10
"""Tolerance with which a contact is located."""
RECOVERED_M: Final = 1e-12
"""A compression of less than this is the rounding of the search: the object has recovered its shape."""


class PadCompliance(NamedTuple):
    """The two fingertip pads in series: a spring, with a damper and a Maxwell branch in parallel to it."""

    stiffness_n_m: float = math.inf
    """inf: rigid pads."""
    damping_n_s_m: float = 0.0
    branch_n_m: float = 0.0
    """Stiffness of the Maxwell branch, by which the pads creep."""
    branch_tau_s: float = 1.0
    """Relaxation time of the Maxwell branch."""
    hardening_m: float = math.inf
    """Compression at which the force of the spring is twice that of a linear one; inf: it is linear."""
    exponent: float = 2.0
    """Of the hardening, which is k u (u / hardening_m)^exponent at a compression u."""


class ObjectModel(NamedTuple):
    """The object between the fingers, and the pads it is pressed through."""

    width_m: float
    table_friction_n: float
    """Friction of the table, which the finger that touches first has to overcome."""
    pads: PadCompliance
    terms: Any
    """The parameters of the object's terms, in their order."""
    held: int = 0
    """1: the object is held fast. The finger that touches first then presses it instead of pushing it."""
    overshoots: int = 1
    """0: a released object recovers its shape without overshoot, so it cannot touch the fingers again meanwhile."""
    balance_rtol: float = BALANCE_RTOL
    """Relative tolerance of the balance of forces."""


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


class _Creep(NamedTuple):
    """How the pads' damper and Maxwell branch act over a step."""

    decay: float
    """Share of the branch's force that is left at the end."""
    mean_n_m: float
    """Stiffness of the branch against the mean rate of the pads' compression."""
    ramp_n_m: float
    """Stiffness of the branch against the change of that rate from its mean to the end."""
    damper_n_s_m: float
    """Damping coefficient of the rate at the end."""
    free_pad_m: float
    """Compression of the pads at the end if nothing pressed them."""


_NO_CREEP: Final = _Creep(decay=1.0, mean_n_m=0.0, ramp_n_m=0.0, damper_n_s_m=0.0, free_pad_m=0.0)


def _linear(pads: PadCompliance, pad_m: float) -> tuple[float, float]:
    return 0.0, 0.0


def hardening(pads: PadCompliance, pad_m: float) -> tuple[float, float]:
    """Return the force (N) of the pads beyond that of their linear spring at this compression, and its slope (N/m)."""
    if pad_m <= 0.0:
        return 0.0, 0.0
    stiffness = pads.stiffness_n_m * (pad_m / pads.hardening_m) ** pads.exponent
    return stiffness * pad_m, stiffness * (1.0 + pads.exponent)


pad_excess: Callable[[PadCompliance, float], tuple[float, float]] = _linear
"""The composition of a scene binds it to `hardening` where the pads are nonlinear."""


def pad_compression(pads: PadCompliance, force_n: float) -> float:
    """Return the compression (m) of the pads at rest under this force."""
    pad = force_n / pads.stiffness_n_m
    if pads.hardening_m < math.inf and pad > 0.0:
        for _ in range(MAX_ITERATIONS):
            excess, slope = hardening(pads, pad)
            step = (pads.stiffness_n_m * pad + excess - force_n) / (pads.stiffness_n_m + slope)
            pad -= step
            if abs(step) <= ARGUMENT_RTOL * pad:
                break
    return pad


def _unbound(params: Any, states: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    raise TypeError("the object has no terms: bind object_force to the sum of its laws")


object_force: Callable[[Any, Any, float, float, float, float], tuple[float, Any]] = _unbound
"""The law of the whole object; the composition of a scene binds it."""


def _no_events(states: Any) -> int:
    return 0


object_phase: Callable[[Any], int] = _no_events
"""A number that changes at the events of the terms; the composition of a scene binds it where a term has events."""


def _nothing_moves(states: Any) -> bool:
    return False


object_moves: Callable[[Any], bool] = _nothing_moves
"""Whether a term moves in a free object (see `Term.moves`); the composition of a scene binds it where one can."""


def is_pressed(contact: Contact) -> bool:
    """Return whether the fingers press the object, or one of them a half of an object that is held fast."""
    return contact.left.force_n > 0.0 or right_of(contact.left, contact.right).force_n > 0.0


def has_event(earlier: Contact, later: Contact) -> bool:
    """Return whether a term of the object has an event between these contacts (see `Term.phase`)."""
    return object_phase(earlier.left.states) != object_phase(later.left.states) or object_phase(
        right_of(earlier.left, earlier.right).states
    ) != object_phase(right_of(later.left, later.right).states)


def no_event(earlier: Contact, later: Contact) -> bool:
    """Return False: `has_event` of an object whose terms have no events."""
    return False


def next_contacts(model: ObjectModel, contact: Contact, gap_m: float) -> tuple[float, float]:
    """Return the gap at which the nearer finger touches the object, and that of the next contact of closing fingers.

    The second is that of the other finger if one touches already.
    """
    offset = 2.0 * abs(contact.offset_m)
    reach = model.width_m + offset
    return reach, reach if gap_m > reach else model.width_m - (offset if model.held == 1 else 0.0)


def with_touch(contact: Contact, gap_m: float, reach_m: float) -> Contact:
    """Return the contact at this gap with `touched` brought up to date.

    `reach_m`: the gap at which the nearer finger touches the object.
    """
    touched = _is_touched(contact, gap_m, reach_m)
    if touched == contact.touched:
        return contact
    left_n, right_n, offset, _, left, right, pending, unbalanced = contact
    return Contact(
        left_n=left_n,
        right_n=right_n,
        offset_m=offset,
        touched=touched,
        left=left,
        right=right,
        pending_s=pending,
        unbalanced=unbalanced,
    )


def _is_touched(contact: Contact, gap_m: float, reach_m: float) -> int:
    """Return 1, or 0 for a released object that has recovered its shape and in which nothing moves any more."""
    left = contact.left
    shape = abs(left.compression_m) + abs(left.pad_m) + _deformation(contact.right)
    separated = gap_m > reach_m and contact.left_n + contact.right_n == 0.0
    if separated and shape <= RECOVERED_M:
        moves = object_moves(left.states) or object_moves(right_of(left, contact.right).states)
        return 1 if moves else 0
    return 1


def _deformation(right: Halves) -> float:
    if len(right) == 0:
        return 0.0
    half: ContactState = right[0]
    return abs(half.compression_m)


def restarted(contact: Contact) -> Contact:
    """Return the contact after an event of a term: the rate of compression before it says nothing any more."""
    left_n, right_n, offset, touched, left, right, pending, unbalanced = contact
    left, right = _restarted(left), _right_restarted(right)
    return Contact(
        left_n=left_n,
        right_n=right_n,
        offset_m=offset,
        touched=touched,
        left=left,
        right=right,
        pending_s=pending,
        unbalanced=unbalanced,
    )


def _right_restarted(right: Halves) -> Halves:
    if len(right) == 0:
        return right
    return (_restarted(right[0]),)


def _restarted(half: ContactState) -> ContactState:
    d, force, slope, states, pad, branch, past = half
    return ContactState(
        compression_m=d,
        force_n=force,
        slope_n_m=slope,
        states=states,
        pad_m=pad,
        branch_n=branch,
        past=_without_past(past.rate_m_s),
    )


def _without_past(rate_m_s: float) -> Past:
    """Return the last step of a compression that says nothing about the next one but its rate."""
    return Past(rate_m_s, 0.0, math.inf, math.inf)


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
        past=_without_past(now.past.rate_m_s),
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
        past=_without_past((d1 - d0) / h),
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
    stiffness, push, creep = pads.stiffness_n_m, pads.stiffness_n_m * closure_m, _NO_CREEP
    creeps = pads.damping_n_s_m > 0.0 or pads.branch_n_m > 0.0
    if creeps:
        creep = _creep(pads, now, h)
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
    pad, branch, past = pad0, branch0, _without_past(rate)
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


def _creep(pads: PadCompliance, now: ContactState, h: float) -> _Creep:
    """Return how the pads' damper and branch act over a step of `h`."""
    x = h / pads.branch_tau_s
    decay = math.exp(-x)
    ramp = pads.branch_n_m * phi_ramp(x, decay)
    mean = pads.branch_n_m * phi1(x, decay) - ramp
    damper = pads.damping_n_s_m + ramp * h
    # Backward Euler, which is enough for pads that touch nothing.
    free = ((mean + damper / h) * now.pad_m - now.branch_n * decay) / (pads.stiffness_n_m + mean + damper / h)
    return _Creep(decay=decay, mean_n_m=mean, ramp_n_m=ramp, damper_n_s_m=damper, free_pad_m=free)


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


def pad_forces(
    model: ObjectModel, contact: Contact, gap_m: float, speed_m_s: float, h: float, still: bool
) -> Contact:
    """Return the contact after the fingers have come to this gap within `h`, closing at `speed_m_s` at the end.

    `still`: the fingers did not move. The time that the contact was behind (`pending_s`) is made up for.
    """
    left_n, right_n, offset, touched, left, right, pending, unbalanced = contact
    table_n, h = model.table_friction_n, h + pending
    closure = model.width_m - gap_m
    left1_n = right1_n = 0.0
    # A pad that alone held the object against the table goes on doing so.
    against_left = min(left_n, table_n) if left_n > right_n else 0.0
    against_right = min(right_n, table_n) if right_n > left_n else 0.0
    if still:
        left1_n, right1_n = against_left, against_right
    elif model.held == 0 and -closure <= 2.0 * abs(offset):
        pushed = 0.5 * max(-closure, 0.0)
        if pushed < abs(offset):
            right1_n = table_n if offset > 0.0 else 0.0
            left1_n = table_n - right1_n
        elif closure > 0.0:
            left1_n, right1_n = against_left, against_right
        offset = offset_of_pushed(offset, pushed)
    # Held fast, each finger presses its own half as if the other did the same. Free, both press the whole.
    shift = 2.0 * offset if model.held == 1 else 0.0
    left, missed = _pressed(model, left, closure - shift, speed_m_s, h, still)
    unbalanced += missed
    right, missed = _right_pressed(model, right, closure + shift, speed_m_s, h, still)
    unbalanced += missed
    if model.held == 1:
        left1_n, right1_n = left.force_n, right_of(left, right).force_n
    else:
        left1_n, right1_n = max(left.force_n, left1_n), max(left.force_n, right1_n)
    return Contact(
        left_n=left1_n,
        right_n=right1_n,
        offset_m=offset,
        touched=touched,
        left=left,
        right=right,
        pending_s=0.0,
        unbalanced=unbalanced,
    )


def with_forces_of(contact: Contact, offset_m: float, pending_s: float) -> Contact:
    """Return the contact with the same forces at another offset; the shapes are computed up to `pending_s` ago."""
    left_n, right_n, _, touched, left, right, _, unbalanced = contact
    return Contact(
        left_n=left_n,
        right_n=right_n,
        offset_m=offset_m,
        touched=touched,
        left=left,
        right=right,
        pending_s=pending_s,
        unbalanced=unbalanced,
    )


def offset_of_pushed(offset_m: float, pushed_m: float) -> float:
    """Return the offset of an object that a finger has pushed to this distance from the middle, from the same side."""
    return pushed_m if offset_m >= 0.0 else -pushed_m


def _pressed(
    model: ObjectModel, half: ContactState, closure_m: float, speed_m_s: float, h: float, still: bool
) -> tuple[ContactState, int]:
    """Return what `solve_contact` does where the fingers touch the object or it is deformed."""
    if not (still or closure_m >= 0.0 or half.compression_m != 0.0):
        return half, 0
    span = h
    if 0.0 <= closure_m <= CONTACT_TOL_M and half.compression_m == 0.0 and closure_m < h * speed_m_s:
        # The contact has only just begun: a damper of the pad has acted since then and no longer.
        span = closure_m / speed_m_s
    return solve_contact(model, half, closure_m, speed_m_s, span)


def _right_pressed(
    model: ObjectModel, right: Halves, closure_m: float, speed_m_s: float, h: float, still: bool
) -> tuple[Halves, int]:
    if len(right) == 0:
        return right, 0
    half, missed = _pressed(model, right[0], closure_m, speed_m_s, h, still)
    return (half,), missed
