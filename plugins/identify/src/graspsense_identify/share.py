"""The share of the force that the cells measure, from the balance of energy of the fingers during the squeeze.

From the contact at speed v0 to the standstill, the effort F works against friction and the object:

    int (F - friction(v)) dx + m v0^2 / 2 = (1 + mu) int N dx,

with the load friction mu and the mass m of the drive (`plant.drive`). The cells measure a share of the force N.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense.plugin_api import Trace
from graspsense_identify.prepare import Squeeze
from graspsense_sim_gripper.run.identification import Drive, SimConfig, drive_and_pads, stribeck_excess

Floats = NDArray[np.float64]

SMALLEST: Final = 0.05
LEAST_WORK_J: Final = 1e-4
"""Below this work the balance says nothing."""
SPEED_TICKS: Final = 6
"""Ticks before and after one over which its speed is measured."""


@frozen(kw_only=True, eq=False)
class Shares:
    """The shares of the force that the cells measure, of the squeezes where the balance gives it."""

    known: Floats = field(factory=lambda: np.empty(0))
    of_friction: float = 0.0
    """The standard deviation of the Coulomb friction over the mean of the measured force."""
    has_cells: bool = True
    """Whether cells measure the force; without, it is whole."""

    @property
    def mean(self) -> float:
        """The mean share, 1 where it is not known. A median would scatter by a quarter more, which `error` has not."""
        return min(float(np.mean(self.known)), 1.0) if len(self.known) else 1.0

    @property
    def error(self) -> float:
        """The relative error of the share of one squeeze: that of the friction over the whole force."""
        return self.of_friction * self.mean

    @property
    def spread(self) -> float:
        """The standard deviation of the share beyond the errors of the squeezes; 0 if there is none.

        The friction varies in every simulated squeeze, too.
        """
        if len(self.known) < 2:
            return 0.0
        error = float(np.mean(self.known)) * self.error
        return math.sqrt(max(float(np.var(self.known, ddof=1)) - error * error, 0.0))

    @property
    def scatter(self) -> float:
        """The standard deviation of the logarithm of the share between squeezes."""
        return float(np.std(np.log(self.known), ddof=1)) if len(self.known) > 1 else 0.0


WHOLE: Final = Shares(has_cells=False)
"""Without cells."""


def measured_shares(config: SimConfig, traces: Sequence[Trace], squeezes: Sequence[Squeeze]) -> Shares:
    """Return the shares of these squeezes."""
    drive, _ = drive_and_pads(config)
    shares = [measured_share(trace, own, drive) for trace, own in zip(traces, squeezes, strict=True)]
    # The mean force over the way of the fingers, as the balance of energy has it.
    means_n = [max(own.work_j(own.force_n) / own.depth_m, 0.1 * own.peak_n) for own in squeezes]
    borne = (1.0 + drive.friction.load_friction_coefficient) * float(np.median(means_n))
    return Shares(
        known=np.array([share for share in shares if math.isfinite(share)]),
        of_friction=float(config.coulomb_spread_n / borne),
    )


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
