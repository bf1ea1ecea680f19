"""Features from before contact: a control from which no object can be recognised, unless the data leak labels.

They use the first half second of the approach, an interval that does not depend on the width of the object: the gap
at its start, and the means of velocity, effort and both pad forces. If a pad exceeds the contact threshold in this
time or shortly after it, the features are missing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from graspsense.core.contact import CONTACT_FORCE_N
from graspsense.core.features import Features, missing
from graspsense.core.signals import APPROACH
from graspsense.core.trace import Trace

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


def before_contact(trace: Trace, contact_force_n: float = CONTACT_FORCE_N) -> Features:
    """Return the features from before contact; they are missing, with the reason, if contact came too early."""
    approach = np.flatnonzero(trace.phase == APPROACH)
    if not len(approach):
        return _missing("there was no approach")
    start = trace.t_s[approach[0]]
    if trace.t_s[approach[-1]] < start + SPAN_S:
        return _missing(f"the approach took less than {SPAN_S:g} s")
    felt = np.maximum(trace.force_left_n, trace.force_right_n) >= contact_force_n
    if bool((felt & (trace.t_s <= start + SPAN_S + GUARD_S)).any()):
        return _missing(f"a pad felt a force in the first {SPAN_S + GUARD_S:g} s of the approach")
    span = approach[trace.t_s[approach] <= start + SPAN_S]
    means = [
        float(column[span].mean())
        for column in (trace.velocity_m_s, trace.effort_n, trace.force_left_n, trace.force_right_n)
    ]
    values = (float(trace.gap_m[span[0]]), *means)
    lacking = [name for name, value in zip(NAMES, values, strict=True) if math.isnan(value)]
    reasons = missing(lacking, "the gripper has no such channel")
    return Features(names=NAMES, values=values, units=_UNITS, reasons=reasons)


def _missing(why: str) -> Features:
    values = (math.nan,) * len(NAMES)
    return Features(names=NAMES, values=values, units=_UNITS, reasons=missing(NAMES, why))
