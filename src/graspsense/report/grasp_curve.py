"""A grasp reduced to what a page draws: gap, force and phase over time, at a few hundred instants."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import Any, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import Trace

INSTANTS: Final = 240
"""Instants kept per grasp, equally spaced in ticks. The ticks around each change of phase are kept as well."""

BEFORE_S: Final = -0.3
"""Time before the contact from which curves that are compared are drawn."""


@frozen(kw_only=True)
class GraspCurve:
    """One grasp over time. A missing value is None.

    Times count from the contact of both pads, which is the change from approach to squeeze, or from the start if there
    was no contact. `force_n` is the mean of both pads.
    """

    label: str
    trial: int
    """Number of the trial within its task or store."""
    t_s: tuple[float | None, ...]
    gap_mm: tuple[float | None, ...]
    force_n: tuple[float | None, ...]
    phase: tuple[str, ...]
    time_unit: str = "s"
    force: str = "force"
    """What `force_n` is: of a gripper whose pads measure no force, the effort."""

    def until_release(self) -> GraspCurve:
        """Return the curve up to where the fingers open again."""
        end = self.phase.index("release") if "release" in self.phase else len(self.phase)
        return evolve(self, **{n: getattr(self, n)[:end] for n in ("t_s", "gap_mm", "force_n", "phase")})

    @property
    def shown_times(self) -> list[float]:
        """The times from shortly before contact on; before that, the fingers move through free space."""
        known = [t for t in self.t_s if t is not None]
        return [t for t in known if t >= BEFORE_S] or known

    def values(self, column: str, begin: float = -inf, end: float = inf) -> list[tuple[float, float]]:
        """Return times and values of a column in this interval of time, without those that are missing."""
        return [
            (t, value)
            for t, value in zip(self.t_s, getattr(self, column), strict=True)
            if t is not None and value is not None and begin <= t <= end
        ]


def grasp_curve(trace: Trace, label: str, trial: int) -> GraspCurve:
    """Return the curve of a trace."""
    n = len(trace)
    instants = set(np.linspace(0, n - 1, min(n, INSTANTS)).round().astype(int).tolist())
    changes = np.flatnonzero(np.diff(trace.phase)) + 1
    instants |= {int(k) for k in changes} | {int(k) - 1 for k in changes}
    chosen = sorted(instants)
    squeezed = np.flatnonzero(trace.phase >= int(Phase.SQUEEZE))
    zero = float(trace.t_s[squeezed[0]]) if len(squeezed) else (float(trace.t_s[0]) if n else 0.0)
    force = (trace.force_left_n[chosen] + trace.force_right_n[chosen]) / 2.0
    no_pads = bool(np.isnan(force).all())
    return GraspCurve(
        label=label,
        trial=trial,
        t_s=_rounded(trace.t_s[chosen] - zero, 4),
        gap_mm=_rounded(trace.gap_m[chosen] * 1e3, 3),
        force_n=_rounded(trace.effort_n[chosen] if no_pads else force, 3),
        phase=tuple(Phase(int(phase)).name.lower() for phase in trace.phase[chosen]),
        time_unit=trace.units.get("t", "s"),
        force="effort" if no_pads else "force",
    )


def peak_in_words(curves: Iterable[GraspCurve]) -> str:
    """Return the largest force of the curves."""
    peak = max((force for curve in curves for force in curve.force_n if force is not None), default=None)
    return "no force" if peak is None else f"up to {peak:.1f} N"


def _rounded(values: Any, digits: int) -> tuple[float | None, ...]:
    return tuple(None if np.isnan(value) else round(float(value), digits) for value in values)
