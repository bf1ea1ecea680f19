"""A grasp reduced to what a page draws of it: gap, force and phase over time, at a few hundred moments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspsense.core.signals import Phase

if TYPE_CHECKING:
    from graspsense.core.trace import Trace

MOMENTS: Final = 240
"""Kept of a grasp; each is the last tick of an equal share of them, and every change of phase is kept besides."""


def grasp_as_json(trace: Trace) -> dict[str, Any]:
    """Return a grasp as JSON values: `t_s`, `gap_mm`, `force_n` (mean of the pads), `phase` by name.

    Times count from the contact of both pads, as the change from approach to squeeze shows it, where there is one.
    """
    n = len(trace)
    which = set(np.linspace(0, n - 1, min(n, MOMENTS)).round().astype(int).tolist())
    changes = np.flatnonzero(np.diff(trace.phase)) + 1
    which |= {int(k) for k in changes} | {int(k) - 1 for k in changes}
    chosen = sorted(which)
    squeezed = np.flatnonzero(trace.phase >= int(Phase.SQUEEZE))
    zero = float(trace.t_s[squeezed[0]]) if len(squeezed) else (float(trace.t_s[0]) if n else 0.0)
    force = (trace.force_left_n[chosen] + trace.force_right_n[chosen]) / 2.0
    return {
        "t_s": _numbers(trace.t_s[chosen] - zero, 4),
        "gap_mm": _numbers(trace.gap_m[chosen] * 1e3, 3),
        "force_n": _numbers(force, 3),
        "phase": [Phase(int(one)).name.lower() for one in trace.phase[chosen]],
        "time_unit": trace.units.get("t", "s"),
    }


def _numbers(values: Any, digits: int) -> list[float | None]:
    return [None if np.isnan(one) else round(float(one), digits) for one in values]
