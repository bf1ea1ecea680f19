"""The share of the force that the cells measure, from the balance of energy of the fingers during the squeeze.

From the contact at speed v0 to the standstill, the effort F works against friction and the object:

    int (F - friction(v)) dx + m v0^2 / 2 = (1 + mu) int N dx,

with the load friction mu and the mass m of the drive (`dynamics.drive`). The cells measure a share of the force N.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense.plugin_api import Trace
from graspsense_identify.prepare import Squeeze
from graspsense_sim_gripper.run.identification import Drive, stribeck_excess

SMALLEST: Final = 0.05
LEAST_WORK_J: Final = 1e-4
"""Below this work the balance says nothing."""
SPEED_TICKS: Final = 6
"""Ticks before and after one over which its speed is measured."""


def measured_share(trace: Trace, squeeze: Squeeze, drive: Drive) -> float:
    """Return the share of the force that the cells measure in this squeeze; NaN where the effort is not known."""
    gap, times = trace.gap_m, trace.t_s
    touched = np.flatnonzero((gap < squeeze.width_m) & (times >= squeeze.t_s[0]))
    if not len(touched) or not np.isfinite(trace.effort_n[touched]).all():
        return math.nan
    onset = int(touched[0])
    last = onset + int(np.argmin(gap[onset : int(touched[-1]) + 1]))
    # The fingers creep at the end, where friction lies anywhere between its limits.
    moving = int(np.argmax(gap[onset : last + 1] <= gap[last] + 0.02 * (gap[onset] - gap[last])))
    part = slice(onset, onset + max(moving, 2))
    closing = -np.diff(gap[part])
    speed = closing / np.maximum(np.diff(times[part]), 1e-9)
    friction = drive.friction
    excess = np.array([stribeck_excess(friction, float(v))[0] for v in speed])
    lost = friction.coulomb_n + excess + friction.damping_n_s_m * speed
    # The effort that a tick shows is that of the step before it.
    driven_j = float(np.sum((trace.effort_n[part][1:] - lost) * closing))
    begin, end = (_kinetic_j(trace, squeeze, drive, k) for k in (part.start, part.stop - 1))
    force = np.interp(times[part], squeeze.t_s[squeeze.sample], squeeze.force_n)
    measured_j = float(np.sum(0.5 * (force[1:] + force[:-1]) * closing))
    available_j = driven_j + begin - end
    if measured_j < LEAST_WORK_J or available_j < LEAST_WORK_J:
        return math.nan
    share = (1.0 + friction.load_friction_coefficient) * measured_j / available_j
    return share if share >= SMALLEST else math.nan


def _kinetic_j(trace: Trace, squeeze: Squeeze, drive: Drive, k: int) -> float:
    """Return the kinetic energy of the drive at a tick: the mean speed over as many ticks before as after it, which a
    constant acceleration does not change."""
    gap = float(trace.gap_m[k])
    _, jacobian = gap_and_rate(drive.link, revolutions_at(drive.link, gap))
    half = min(SPEED_TICKS, k, len(trace.t_s) - 1 - k)
    low, high = k - half, k + half
    elapsed = float(trace.t_s[high] - trace.t_s[low])
    speed = float(trace.gap_m[low] - trace.gap_m[high]) / elapsed if elapsed > 0.0 else 0.0
    return 0.5 * drive.inertia / (jacobian * jacobian) * speed * speed
