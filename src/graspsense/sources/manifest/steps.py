"""The steps from the samples of a file to one grasp: duplicates, squeezes, cutting and resampling."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve

from graspsense.core.grasp.gap_resolution import gap_resolution
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.limits import SAMPLES
from graspsense.sources.grasp_columns import PLAUSIBLE, GraspColumns, check_increasing, finger_sides, only

if TYPE_CHECKING:
    from numpy.typing import NDArray

RUPTURE_FALL: Final = 0.3
"""Share of its peak by which the force falls when an object ruptures."""
RELEASED: Final = 0.1
"""Share of its peak below which the force is when the object is released."""
LOADED: Final = 0.2
"""Share of the range of the force above which an object is held, where squeezes are to be found."""
FEWEST: Final = 3
"""Fewest samples of a squeeze that is found."""


def without_duplicates(columns: GraspColumns) -> GraspColumns:
    """Return the samples without those that have the time of the one before."""
    new = np.concatenate(([True], np.diff(columns.t_s) != 0.0))
    dropped = len(new) - int(new.sum())
    if not dropped:
        return columns
    return only(columns, new, "with the time of the one before")


@np.errstate(all="ignore")
def squeezes(columns: GraspColumns) -> list[GraspColumns]:
    """Return each squeeze of a recording, with the approach before it. Raises DataDamaged if there is none.

    An object is held while the force exceeds its lowest values by a fifth of its range. A squeeze begins halfway
    after the one before, where both fingers are free. A force that is missing, or that no gripper has, is of its own
    squeeze: there the last force before it counts.
    """
    force = _known_force(columns)
    low, high = np.percentile(force, [5.0, 99.5])
    held = force > low + LOADED * (high - low)
    edges = np.flatnonzero(np.diff(held.astype(np.int8)))
    begins = [0, *(edges + 1).tolist()]
    runs = [
        (begin, end)
        for begin, end in zip(begins, [*begins[1:], len(held)], strict=True)
        if held[begin] and end - begin >= FEWEST
    ]
    if not runs or not high > low:
        raise DataDamaged(f"{columns.source}: no squeeze was found, because its force never rises")
    bounds = [
        0,
        *((end + begin) // 2 for (_, end), (begin, _) in pairwise(runs)),
        len(held),
    ]
    return [
        columns.rows(slice(start, end), f"squeeze {k}") for k, (start, end) in enumerate(pairwise(bounds), 1)
    ]


def _known_force(columns: GraspColumns) -> NDArray[np.float64]:
    """Return the mean force, with the last plausible one in the place of every other."""
    force = columns.force_n
    known = np.isfinite(force)
    if not columns.units.get("force"):
        low, high, *_ = PLAUSIBLE["force"]
        known &= (force >= low) & (force <= high)
    if not known.any():
        raise DataDamaged(f"{columns.source}: no squeeze was found, because its force has no number")
    last = np.maximum.accumulate(np.where(known, np.arange(len(force)), int(known.argmax())))
    return force[last]


@np.errstate(all="ignore")
def cut_at(columns: GraspColumns, where: str) -> GraspColumns:
    """Return the samples up to the rupture or the release of the object; all of them if there is none.

    At a rupture the force falls by 30 % of its peak while the fingers do not open; it ends with the peak before. At the
    release the force falls below 10 % of its peak.
    """
    end = _rupture(columns.force_n) if where == "rupture" else _release(columns.force_n)
    if end is None:
        note = f"no {where} was found: all samples are used"
        return evolve(columns, notes=(*columns.notes, note))
    cut = columns.rows(slice(0, end))
    return evolve(
        cut, notes=(*cut.notes, f"cut at the {where}, after {columns.t_s[end - 1] - columns.t_s[0]:.3g} s")
    )


def _rupture(force: NDArray[np.float64]) -> int | None:
    floor = float(force.min())
    peaks = np.maximum.accumulate(force) - floor
    # Noise before the contact falls by a large share of itself.
    loaded = peaks > LOADED * float(peaks[-1])
    fallen = np.flatnonzero(loaded & (force - floor < (1.0 - RUPTURE_FALL) * peaks))
    return int(np.argmax(force[: fallen[0]])) + 1 if len(fallen) else None


def _release(force: NDArray[np.float64]) -> int | None:
    peak = int(force.argmax())
    floor = float(force.min())
    released = np.flatnonzero(force[peak:] - floor < RELEASED * (force[peak] - floor))
    return peak + int(released[0]) if len(released) else None


@np.errstate(all="ignore")
def resampled(columns: GraspColumns, rate_hz: float) -> GraspColumns:
    """Return the columns at this rate, interpolated. Raises DataDamaged if the time does not increase.

    A gap in steps keeps its steps, because between them it is not known; they show how finely it was measured.
    """
    t = columns.t_s
    check_increasing(columns)
    duration_s = float(t[-1] - t[0])
    samples = duration_s * rate_hz + 1.0
    if not samples <= SAMPLES.most:
        many = int(min(samples, 1e18))
        raise DataDamaged(
            f"{columns.source}: {duration_s:g} s at resample_hz = {rate_hz:g} are {SAMPLES.exceeded(many)}"
        )
    times = t[0] + np.arange(int(duration_s * rate_hz + 1e-9) + 1) / rate_hz

    contact = int((columns.force_n - columns.force_n.min() > LOADED * np.ptp(columns.force_n)).argmax())
    coarse = gap_resolution(t, columns.gap_m, contact).step_m > 0.0

    def along(values: NDArray[np.float64]) -> NDArray[np.float64]:
        if values.ndim == 1:
            column: NDArray[np.float64] = np.interp(times, t, values)
            return column
        return np.column_stack([np.interp(times, t, column) for column in values.T])

    def along_own(name: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return values if name in columns.times else along(values)

    scalars = {name: along_own(name, values) for name, values in columns.scalars.items()}
    sides = (
        finger_sides(columns.fingers, scalars)
        if columns.fingers
        else (along(columns.left_n), along(columns.right_n))
    )
    return evolve(
        columns,
        lines=None,
        t_s=times,
        gap_m=columns.gap_m[np.searchsorted(t, times, side="right") - 1] if coarse else along(columns.gap_m),
        left_n=sides[0],
        right_n=sides[1],
        effort_n=None if columns.effort_n is None else along(columns.effort_n),
        velocity_m_s=None if columns.velocity_m_s is None else along(columns.velocity_m_s),
        scalars=scalars,
        arrays={name: along_own(name, values) for name, values in columns.arrays.items()},
        notes=(*columns.notes, f"resampled to {rate_hz:g} Hz"),
    )
