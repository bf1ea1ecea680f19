"""Eight features of a whole grasp, from the force over the gap and from the cell images.

A cell image is taken relative to the last one before contact, so that no zero of the cells is in it.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import (
    CONTACT_FORCE_N,
    HOLD,
    RELEASE,
    Channel,
    Feature,
    Features,
    FeatureSet,
    Trace,
    missing,
    setting,
)

Floats = NDArray[np.float64]

CURVE: Final = (
    Feature("peak_force", "N", "largest mean force of the pads, from contact to the end of the hold"),
    Feature("gap_at_peak", "m", "gap at the largest force"),
    Feature(
        "stiffness_ratio",
        "1",
        "slope of force over gap in the second half of the squeeze, over that in the first",
    ),
    Feature("hysteresis", "1", "share of the work of the squeeze that the release does not give back"),
    Feature("relaxation_time", "s", "time from the peak until 63 % of the relaxation of the hold has passed"),
    Feature("contact_area", "cells", "cells of a pad above a tenth of the fullest cell, at the peak"),
    Feature("contact_row", "rows", "centre of the contact along the pad, at the peak"),
    Feature("contact_spread", "rows", "standard deviation of the contact along the pad, at the peak"),
)
CHANNELS: Final = (
    Channel("gap", "m"),
    Channel("force_left", "N"),
    Channel("force_right", "N"),
    Channel("pads", "counts"),
)
NAMES: Final = tuple(feature.name for feature in CURVE)
IMAGE: Final = NAMES[5:]
LEAST_TRAVEL_M: Final = 2e-4
FIRST_PAD_CELL: Final = 7
"""The first cell on the gripping face of a PR2 fingertip; the rows and columns below are those of the PR2."""
LEAST_LOSS: Final = 0.02
"""Share of the peak by which the force must fall in the hold for the relaxation to exceed the steps of the cells."""


@frozen(kw_only=True)
class GraspCurveConfig:
    """The threshold of contact."""

    contact_force_n: float = setting(
        default=CONTACT_FORCE_N,
        unit="N",
        above=0.0,
        plausible=(0.01, 20.0),
        meaning="Force on each pad at contact; that of the controller unless it is given here.",
        follows="controller.contact_force_n",
    )


class GraspCurveFeatures(FeatureSet[GraspCurveConfig]):
    """Extracts the eight features."""

    requires = CHANNELS
    features = CURVE

    def extract(self, trace: Trace) -> Features:
        """Return the features; an undefined one is NaN with its reason."""
        return self.result(*_curve(trace, self.config.contact_force_n), trace.units)


def _curve(trace: Trace, contact_force_n: float) -> tuple[dict[str, float], dict[str, str]]:
    """Return the defined features, and the reasons for the others."""
    known = np.isfinite(trace.gap_m) & np.isfinite(trace.force_left_n) & np.isfinite(trace.force_right_n)
    touch = known & (trace.force_left_n >= contact_force_n) & (trace.force_right_n >= contact_force_n)
    touch &= trace.phase <= HOLD
    if not touch.any():
        return {}, missing(NAMES, f"the pads never felt {contact_force_n:g} N at the same time")
    contact = int(touch.argmax())
    grasp = np.flatnonzero(known & (trace.phase <= HOLD))
    grasp = grasp[grasp >= contact]
    force = 0.5 * (trace.force_left_n + trace.force_right_n)
    peak = int(grasp[np.argmax(force[grasp])])
    values = {"peak_force": float(force[peak]), "gap_at_peak": float(trace.gap_m[peak])}
    reasons: dict[str, str] = {}
    squeeze = grasp[grasp <= peak]
    release = np.flatnonzero(known & (trace.phase == RELEASE))
    for name, value in (
        ("stiffness_ratio", _stiffness_ratio(trace.gap_m[squeeze], force[squeeze])),
        ("hysteresis", _hysteresis(trace.gap_m, _in_time(trace, force), squeeze, release)),
        ("relaxation_time", _relaxation(trace.t_s, force, grasp[grasp >= peak])),
    ):
        if isinstance(value, str):
            reasons[name] = value
        else:
            values[name] = value
    moments = _moments(trace, float(trace.t_s[contact]), float(trace.t_s[peak]))
    if isinstance(moments, str):
        return values, {**reasons, **missing(IMAGE, moments)}
    return {**values, **dict(zip(IMAGE, moments, strict=True))}, reasons


def _stiffness_ratio(gap: Floats, force: Floats) -> float | str:
    travel = float(gap[0] - gap[-1])
    if travel < LEAST_TRAVEL_M:
        return f"the squeeze closed by {max(travel, 0.0) * 1e3:.2g} mm only"
    half = 0.5 * (gap[0] + gap[-1])
    slopes = []
    for part in (gap >= half, gap <= half):
        d, f = gap[part] - gap[part].mean(), force[part] - force[part].mean()
        spread = float((d * d).sum())
        if spread <= 1e-12:
            return "half of the squeeze has no travel"
        slopes.append(-float((d * f).sum()) / spread)
    if slopes[0] <= 0.0:
        return "the force did not rise in the first half of the squeeze"
    return slopes[1] / slopes[0]


def _in_time(trace: Trace, force: Floats) -> Floats:
    """Return the force, interpolated linearly between cell images if there are any.

    In between, a gripper gives the force of the image before: at the speed of a release it would be paired with a gap
    that is millimetres further on, and give back more than was put in.
    """
    new = np.searchsorted(trace.t_s, trace.pad_t_s)
    new = new[new < len(force)]
    if len(new) < 2:
        return force
    return np.interp(trace.t_s, trace.t_s[new], force[new])


def _hysteresis(gap: Floats, force: Floats, squeeze: Any, release: Any) -> float | str:
    if len(release) < 2 or not np.isfinite(force[release]).all():
        return "the trace ends before the release, or gives no force in it"
    put_in = _work(gap[squeeze], force[squeeze])
    if not put_in > 1e-6:
        return "no work was done in the squeeze"
    # The work that the object gave back while the fingers opened over the squeezed distance.
    way = release[gap[release] <= gap[squeeze[0]]]
    given_back = -_work(gap[way], force[way]) if len(way) > 1 else 0.0
    return 1.0 - given_back / put_in


def _work(gap: Floats, force: Floats) -> float:
    return float((0.5 * (force[1:] + force[:-1]) * -np.diff(gap)).sum())


def _relaxation(t_s: Floats, force: Floats, held: Any) -> float | str:
    if len(held) < 2:
        return "the trace ends with the peak"
    peak, last = float(force[held[0]]), float(force[held[-1]])
    if peak - last < LEAST_LOSS * peak:
        return f"the force lost less than {LEAST_LOSS:.0%} of its peak"
    fallen = force[held] <= peak - (1.0 - math.exp(-1.0)) * (peak - last)
    return float(t_s[held[int(np.argmax(fallen))]] - t_s[held[0]])


def _moments(trace: Trace, contact_s: float, peak_s: float) -> tuple[float, float, float] | str:
    """Return area, row and spread of the contact in the last image before the peak, or the reason for their absence."""
    untouched = np.flatnonzero(trace.pad_t_s < contact_s)
    upto = np.flatnonzero((trace.pad_t_s <= peak_s) & (trace.pad_t_s >= contact_s))
    if not len(trace.pad_t_s):
        return "there are no cell images"
    if not len(untouched) or not len(upto):
        return "no cell image lies before the contact, or none between contact and peak"
    rows = np.arange(trace.pad_left.shape[1] - FIRST_PAD_CELL) // 3
    moments = []
    for cells in (trace.pad_left, trace.pad_right):
        face = np.clip(cells[upto[-1], FIRST_PAD_CELL:] - cells[untouched[-1], FIRST_PAD_CELL:], 0.0, None)
        total = float(face.sum())
        if not total > 0.0:
            return "the gripping face of a pad felt nothing at the peak, or gave no number"
        row = float((rows * face).sum()) / total
        spread = math.sqrt(float(((rows - row) ** 2 * face).sum()) / total)
        moments.append((float((face > 0.1 * face.max()).sum()), row, spread))
    (a, b, c), (d, e, f) = moments
    return 0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f)
