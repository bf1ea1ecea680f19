"""Features from before contact: a control from which no object can be recognised, unless the data leak labels.

They use the first half second of the approach, an interval that does not depend on the width of the object: the gap
at its start, and the means of velocity, effort and both pad forces. If a pad exceeds the contact threshold in this
time or shortly after it, the features are missing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from graspsense.core.components.compiled_features import CompiledExtraction, TickColumns, listed_columns
from graspsense.core.control.contact import CONTACT_FORCE_N, either_touches
from graspsense.core.values.features import Features, missing
from graspsense.core.values.signals import APPROACH
from graspsense.core.values.trace import Trace

SPAN_S: Final = 0.5
GUARD_S: Final = 0.1
"""A pad image can be 41 ms old, so a contact within this time after the interval may already have begun in it."""

NAMES: Final = (
    "gap_at_start",
    "velocity_before",
    "effort_before",
    "force_left_before",
    "force_right_before",
)
_UNITS: Final = ("m", "m/s", "N", "N", "N")


def contact_force_of(settings: Mapping[str, Mapping[str, Any]]) -> float:
    """Return the contact threshold of these settings (N): that of the controller, which features follow."""
    return float(settings.get("controller", {}).get("contact_force_n", CONTACT_FORCE_N))


NO_APPROACH: Final = 0.0
SHORT: Final = 1.0
TOUCHED: Final = 2.0
FREE: Final = 3.0
"""What was seen of the approach (`Before.seen`); only with FREE there are features."""


class Before(NamedTuple):
    """What the features follow from; all values are NaN unless `seen` is FREE."""

    seen: float
    gap_m: float = math.nan
    velocity_m_s: float = math.nan
    effort_n: float = math.nan
    force_left_n: float = math.nan
    force_right_n: float = math.nan


def before_contact(trace: Trace, contact_force_n: float = CONTACT_FORCE_N) -> Features:
    """Return the features from before contact; they are missing, with the reason, if contact came too early."""
    return _features(measure((contact_force_n,), listed_columns(trace)))


def before_contact_compiled(contact_force_n: float) -> CompiledExtraction:
    """Return `before_contact` in a form that a simulator compiles."""
    return CompiledExtraction(measure, (contact_force_n,), _features, reads_release=False)


def measure(params: tuple[float], ticks: TickColumns) -> Before:
    """Return what `before_contact` measures, from the columns of a grasp; it can be compiled."""
    n, start = len(ticks.phase), 0
    while start < n and ticks.phase[start] != APPROACH:
        start += 1
    if start == n:
        return _unmeasured(NO_APPROACH)
    last = n - 1
    while ticks.phase[last] != APPROACH:
        last -= 1
    start_s = ticks.t_s[start]
    if ticks.t_s[last] < start_s + SPAN_S:
        return _unmeasured(SHORT)
    count, velocity, effort, left, right = 0, 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        if ticks.t_s[i] > start_s + SPAN_S + GUARD_S:
            break
        if either_touches(ticks.force_left_n[i], ticks.force_right_n[i], params[0]):
            return _unmeasured(TOUCHED)
        if ticks.phase[i] == APPROACH and ticks.t_s[i] <= start_s + SPAN_S:
            count += 1
            velocity += ticks.velocity_m_s[i]
            effort += ticks.effort_n[i]
            left += ticks.force_left_n[i]
            right += ticks.force_right_n[i]
    return Before(
        seen=FREE,
        gap_m=ticks.gap_m[start],
        velocity_m_s=velocity / count,
        effort_n=effort / count,
        force_left_n=left / count,
        force_right_n=right / count,
    )


def _unmeasured(seen: float) -> Before:
    """Return that there are no values, with the reason."""
    nan = math.nan
    return Before(seen=seen, gap_m=nan, velocity_m_s=nan, effort_n=nan, force_left_n=nan, force_right_n=nan)


def _features(measured: Any) -> Features:
    seen, *values = measured
    lacking = [name for name, value in zip(NAMES, values, strict=True) if math.isnan(value)]
    reasons = missing(lacking, _WHY_MISSING[seen])
    return Features(names=NAMES, values=tuple(values), units=_UNITS, reasons=reasons)


_WHY_MISSING: Final = {
    NO_APPROACH: "there was no approach",
    SHORT: f"the approach took less than {SPAN_S:g} s",
    TOUCHED: f"a pad felt a force in the first {SPAN_S + GUARD_S:g} s of the approach",
    FREE: "the gripper has no such channel",
}
