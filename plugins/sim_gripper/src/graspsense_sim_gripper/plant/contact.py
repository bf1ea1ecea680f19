"""The contact: the forces on both pads, and the object on its table.

An object that is free stands on a table: the finger that touches first pushes it, against the friction of the table,
until both fingers touch. An object that is held fast stays where it is, and each finger presses its own half.
"""

from __future__ import annotations

from typing import Final

from graspsense_sim_gripper.plant.balance import solve_contact
from graspsense_sim_gripper.plant.object_model import ObjectModel, object_moves, object_phase
from graspsense_sim_gripper.plant.state import Contact, ContactState, Halves, right_of, without_past

CONTACT_TOL_M: Final = 1e-10
"""Tolerance with which a contact is located."""
RECOVERED_M: Final = 1e-12
"""A compression of less than this is the rounding of the search: the object has recovered its shape."""


def is_pressed(contact: Contact) -> bool:
    """Return whether the fingers press the object, or one of them a half of an object that is held fast."""
    return contact.left.force_n > 0.0 or right_of(contact.left, contact.right).force_n > 0.0


def has_event(earlier: Contact, later: Contact) -> bool:
    """Return whether a term of the object has an event between these contacts (see `Term.phase`)."""
    return object_phase(earlier.left.states) != object_phase(later.left.states) or object_phase(
        right_of(earlier.left, earlier.right).states
    ) != object_phase(right_of(later.left, later.right).states)


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
        past=without_past(past.rate_m_s),
    )


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
