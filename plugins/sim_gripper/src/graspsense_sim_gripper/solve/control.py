"""Step control: from the error of a step to its acceptance and the length of the next one.

The elementary controller of Hairer, Norsett and Wanner (Solving Ordinary Differential Equations I, II.4), for errors
that are proportional to the third power of the step.
"""

from __future__ import annotations

import math
from typing import Final

from graspsense_sim_gripper.solve.scheme import (
    FORCE_SCALE_N,
    SPEED_SCALE_M_S,
    Attempt,
    Start,
    Steps,
    StepState,
)

SAFETY: Final = 0.9
"""Factor on the step whose error would be the tolerance."""
MIN_FACTOR: Final = 0.2
"""Smallest ratio of a step to the one before."""
MAX_FACTOR: Final = 9.0
"""Largest ratio, which an error below `SMALL_ERROR` allows."""
SMALL_ERROR: Final = 1e-3
"""SAFETY times the inverse cube root of this is `MAX_FACTOR`."""
EXPONENT: Final = -1.0 / 3.0
"""The error of a step is proportional to the third power of its length."""
FREE_GROWTH: Final = 4.0
"""Largest ratio of a step to the last one while nothing is pressed, where errors are estimated; there is no limit where
they are not."""
MIN_STEP_S: Final = 1e-10
"""Length at which a step is accepted regardless of its error, which is then rounding."""
LONG_STEP_S: Final = 10.0
"""Longer steps are not limited any more."""
CONTACT_STEP_S: Final = 0.01
"""Length of the first step after a contact, for a tolerance of 1."""
CONTACT_SHARE: Final = 0.01
"""The same as a share of the longest step, where no error is estimated."""
MIN_CONTACT_STEP_S: Final = 1e-8
"""Smallest length of that step; over a shorter one the rate of a compression is mostly rounding."""
MAX_STEPS: Final = 20_000
"""Largest number of steps in a tick. The rest of the tick is then one step, regardless of its error."""
TIME_RTOL: Final = 1e-9
"""The rest of a tick is one step if it exceeds the length of a step by less than this fraction."""


def next_length(
    steps: Steps, step: StepState, left_s: float, n_steps: int, touched: int
) -> tuple[float, bool]:
    """Return the length of the next step if `left_s` of the tick is left, and whether it is accepted in any case.

    `touched`: whether the object was touched (1).
    """
    h = min(step.next_s, steps.longest_s)
    if touched == 1:
        h = min(h, steps.longest_touched_s)
    forced = n_steps >= MAX_STEPS
    if forced or left_s <= h * (1.0 + TIME_RTOL):
        h = left_s
    elif left_s < 2.0 * h:
        # Two equal steps instead of a full and a short one.
        h = 0.5 * left_s
    return h, forced


def fits_a_step(steps: Steps, step: StepState, dt: float) -> bool:
    """Return whether a whole tick of `dt` is no longer than the next step may be, where nothing is compressed."""
    return steps.longest_s >= dt <= step.next_s


def relative_error(tolerance: float, start: Start, attempt: Attempt) -> float:
    """Return the error of a step relative to the tolerance, 0 if no error is estimated."""
    if attempt.speed_error_m_s + attempt.force_error_n <= 0.0:
        return 0.0
    motion0, motion1 = start.motion, attempt.motion
    load0 = 0.5 * (start.contact.left_n + start.contact.right_n)
    load1 = 0.5 * (attempt.contact.left_n + attempt.contact.right_n)
    speed0 = abs(motion0.speed_rev_s * motion0.jacobian_m_rev)
    speed1 = abs(motion1.speed_rev_s * motion1.jacobian_m_rev)
    return (
        max(
            attempt.speed_error_m_s / max(speed0, speed1, SPEED_SCALE_M_S),
            attempt.force_error_n / max(load0, load1, FORCE_SCALE_N),
        )
        / tolerance
    )


def accept(error: float, h: float, last: StepState, growth: float, forced: bool) -> tuple[bool, StepState]:
    """Return whether a step of `h` with this relative error is accepted, and the state of the control after it.

    `growth`: largest ratio of the next step to this one. `forced`: the step is accepted regardless of its error.
    """
    step, n, unresolved = last
    if error == 0.0:
        if step < math.inf:
            step = growth * max(step, h) if step < LONG_STEP_S else math.inf
        return True, StepState(step, n + 1, unresolved)
    allowed = h * max(SAFETY * error**EXPONENT, MIN_FACTOR) if error > SMALL_ERROR else MAX_FACTOR * h
    proposed = min(allowed, growth * h)
    if error <= 1.0:
        # A step that was shortened by an event or by the end of the tick does not shorten the next one.
        step = proposed if h >= step else max(proposed, step, min(allowed, growth * step))
        return True, StepState(step, n + 1, unresolved)
    if h > MIN_STEP_S and not forced:
        step = proposed if 1.0 < error < math.inf else MIN_FACTOR * h
        return False, StepState(step, n, unresolved)
    return True, StepState(step, n + 1, unresolved + 1)


def contact_step_s(steps: Steps) -> float:
    """Return the length of the first step after a contact: a damper begins to relax there, which needs short steps."""
    if steps.growth == math.inf:
        return math.inf
    estimated = steps.tolerance < math.inf
    contact_s = CONTACT_STEP_S * steps.tolerance if estimated else CONTACT_SHARE * steps.longest_s
    return max(contact_s, MIN_CONTACT_STEP_S)


def after_contact(steps: Steps, step: StepState) -> StepState:
    """Return the state of the control after a contact or an event, whatever the length of the step that located it."""
    return StepState(contact_step_s(steps), step.n_steps, step.unresolved)
