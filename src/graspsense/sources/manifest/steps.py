"""The steps from the samples of a file to one grasp: duplicates, squeezes, cutting and resampling."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any, Final

import numpy as np
from attrs import evolve

from graspsense.core.grasp.gap_resolution import gap_resolution
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.limits import SAMPLES
from graspsense.sources.columns.grasp_columns import (
    NAMES,
    PLAUSIBLE,
    GraspColumns,
    check_increasing,
    finger_sides,
    only,
)
from graspsense.sources.formats.table import Numbers
from graspsense.sources.manifest.closings import closings, without_rise

RUPTURE_FALL: Final = 0.3
"""Share of its peak by which the force falls when an object ruptures."""
RELEASED: Final = 0.1
"""Share of its peak below which the force is when the object is released."""
LOADED: Final = 0.2
"""Share of its force below which a squeeze has ended."""
WEAKEST: Final = 0.1
"""Share of the usual force by which a squeeze rises at least."""
UNLOADED: Final = 0.02
"""Share of the range of the force up to which nothing is held."""
NOISE: Final = 6.0
"""A force whose range is at most so many usual second differences is noise alone."""
STAYS: Final = 0.01
"""Share of its range by which the gap of fingers that do not open changes."""
BELOW: Final = 0.5
"""Share of its range by which a force is below all others in a glitch."""
SHORTEST_RELEASE_S: Final = 0.1
"""Fingers need this time (s) at least to open and to close again."""
FEWEST: Final = 3
"""Fewest samples of a squeeze that is found."""


def without_duplicates(columns: GraspColumns) -> GraspColumns:
    """Return the samples without those that have the time of the one before."""
    new = np.concatenate(([True], np.diff(columns.t_s) != 0.0))
    return columns if new.all() else only(columns, new, "with the time of the one before")


@np.errstate(all="ignore")
def squeezes(columns: GraspColumns) -> list[GraspColumns]:
    """Return each squeeze of a recording, with the approach before it. Raises DataDamaged if there is none.

    A squeeze rises above the force before it by a tenth of the usual force, and ends where it has lost four fifths of
    what it rose by, so squeezes of different forces and a zero that drifts are told apart. The next one begins halfway
    after the end, where both fingers are free. A force that is missing, or that no gripper has, is of its own
    squeeze: there the last force before it counts. A glitch of two samples does not end a squeeze, nor does a force
    that goes and comes back while the fingers close further. Fingers that open end it, if the force then stays what
    it is, as after a change of its zero.
    """
    force = _known_force(columns)
    runs = _of_one_closing(columns.gap_m, held_runs(force, np.diff(columns.t_s)))
    runs = list(_divided(columns, force, runs))
    if not runs:
        raise DataDamaged(f"{columns.source}: no squeeze was found, because its force never rises")
    between = (_middle(columns.t_s, end, begin) for (_, end), (begin, _) in pairwise(runs))
    bounds = [0, *between, len(force)]
    parts = [
        columns.rows(slice(start, end), f"squeeze {k}") for k, (start, end) in enumerate(pairwise(bounds), 1)
    ]
    for k, ((_, end), (begin, _)) in enumerate(pairwise(runs), 1):
        if _stays_closed(columns.gap_m, end, begin):
            told = (
                f"the gap stays from {columns.t_s[end]:.4g} to {columns.t_s[begin]:.4g} s, while the force is gone and "
                "comes back: did its sensor fail for a moment? Then both parts are of one squeeze: split by a column"
            )
            parts[k] = evolve(parts[k], warnings=(*parts[k].warnings, told))
    missed = without_rise(columns, runs)
    parts[0] = evolve(parts[0], warnings=(*parts[0].warnings, *missed))
    return [_measured(part) for part in parts]


def _measured(columns: GraspColumns) -> GraspColumns:
    """Return the samples in which gap and forces have a number."""
    known = ~np.isnan(columns.gap_m + columns.force_n)
    place = columns.place(int(known.argmin()))
    return columns if known.all() or not known.any() else only(columns, known, f"without a number ({place})")


def _of_one_closing(gap: Numbers, runs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the squeezes; those between which the fingers only close further are one, with a bump before it."""
    known = gap[np.isfinite(gap)]
    least = STAYS * float(np.ptp(known)) if len(known) else 0.0
    joined: list[tuple[int, int]] = []
    for begin, end in runs:
        if joined:
            start, earlier = joined[-1]
            between, narrowest = gap[earlier - 1 : begin + 1], np.nanmin(gap[start:earlier], initial=np.inf)
            closes = between[0] - between[-1] > least and np.nanmax(between) < between[0] + least
            # In a squeeze with a force that stuck they had opened, and a gap that stopped shows no closing.
            stopped = not np.ptp(gap[start:earlier]) > 0.0
            if closes and between[0] < narrowest + least and not stopped:
                begin = joined.pop()[0]
        joined.append((begin, end))
    return joined


def _divided(columns: GraspColumns, force: Numbers, runs: list[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Yield the squeezes, divided where the fingers are open and the force does not change while they move."""
    t_s, closed = columns.t_s, closings(columns.gap_m)
    for begin, end in runs:
        inside = [(closing, opened) for closing, opened in closed if closing < end and opened > begin]
        share = LOADED * float(np.ptp(force[begin:end]))
        for (_, opened), (closing, _) in pairwise(inside):
            lasts = closing - opened >= FEWEST and t_s[closing] - t_s[opened] >= SHORTEST_RELEASE_S
            if not (begin < opened and closing < end and lasts):
                continue
            free = force[opened:closing]
            held = min(force[begin:opened].max(), force[closing:end].max())
            if np.ptp(free) < share < held - free.max():
                yield begin, opened
                begin = closing
        yield begin, end


def _stays_closed(gap: Numbers, end: int, begin: int) -> bool:
    """Return whether a gap that is recorded does not open between the end of a squeeze and the begin of the next."""
    known, between = gap[np.isfinite(gap)], gap[end:begin]
    span = float(np.ptp(known)) if len(known) else 0.0
    return bool(
        span > 0.0 and np.nanmax(between, initial=-np.inf) - np.nanmin(between, initial=np.inf) < STAYS * span
    )


def _middle(t_s: Numbers, end: int, begin: int) -> int:
    """Return the sample with which the next squeeze begins: the middle, or where the clock begins anew."""
    back = np.flatnonzero(np.diff(t_s[end - 1 : begin + 1]) < 0.0)
    return end + int(back[0]) if len(back) else (end + begin) // 2


def held_runs(force: Numbers, steps_s: Numbers) -> list[tuple[int, int]]:
    """Return the first sample of each squeeze and the one after its last."""
    noise = NOISE * float(np.median(np.abs(np.diff(force, 2)))) if len(force) > 2 else 0.0
    around = np.pad(force, FEWEST - 1, mode="edge")
    force = np.median(np.lib.stride_tricks.sliding_window_view(around, 2 * FEWEST - 1), axis=1)
    low, high = np.percentile(force, [5.0, 99.5])
    if not high - low > noise:
        return []
    force = np.where(force < low - BELOW * (high - low), low, force)
    loaded = force[force > low + max(noise, UNLOADED * (high - low))]
    usual = float(np.median(loaded)) - float(low) if len(loaded) else float(high - low)
    rise = max(noise, WEAKEST * usual)
    usual_s = float(np.median(steps_s)) if len(steps_s) else 0.0
    shortest = SHORTEST_RELEASE_S / usual_s if usual_s else 0.0  # stamps with few digits are alike
    joined: list[tuple[int, int]] = []
    for begin, end in _rises(force, rise, max(rise, 0.5 * usual)):
        if end - begin < FEWEST:
            continue
        if joined and begin - joined[-1][1] < shortest:
            begin = joined.pop()[0]
        joined.append((begin, end))
    return joined


def _rises(force: Numbers, rise: float, held_at_first: float) -> Iterator[tuple[int, int]]:
    """Yield where the force rises by `rise` above the least before it, up to where it has lost most of that.

    A recording that begins in a squeeze falls first, by `held_at_first`.
    """
    base = peak = start = float(force[0])
    begin: int | None = None
    for k, value in enumerate(force.tolist()):
        if begin is not None:
            peak = max(peak, value)
            if value - base < LOADED * (peak - base):
                yield begin, k
                begin, base, start = None, value, -math.inf
            continue
        base = min(base, value)
        if value - base > rise:
            begin, peak = k, value
        elif start - value > held_at_first:
            yield 0, k
            start = -math.inf
    if begin is not None:
        yield begin, len(force)


def _known_force(columns: GraspColumns) -> Numbers:
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


def _rupture(force: Numbers) -> int | None:
    floor = float(force.min())
    peaks = np.maximum.accumulate(force) - floor
    # Noise before the contact falls by a large share of itself.
    loaded = peaks > LOADED * float(peaks[-1])
    fallen = np.flatnonzero(loaded & (force - floor < (1.0 - RUPTURE_FALL) * peaks))
    return int(np.argmax(force[: fallen[0]])) + 1 if len(fallen) else None


def _release(force: Numbers) -> int | None:
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
    coarse = gap_resolution(t.tolist(), columns.gap_m.tolist(), contact).step_m > 0.0

    def along(name: str, values: Numbers) -> Numbers:
        if name in columns.times:
            return values
        parts = [np.interp(times, t, column) for column in values.reshape(len(t), -1).T]
        return np.column_stack(parts).reshape(len(times), *values.shape[1:])

    named: dict[str, Any] = {
        name: along(name, values) for name in NAMES if (values := getattr(columns, name)) is not None
    }
    named["t_s"] = times
    if coarse:
        named["gap_m"] = columns.gap_m[np.searchsorted(t, times, side="right") - 1]
    scalars = {name: along(name, values) for name, values in columns.scalars.items()}
    if columns.fingers:
        named["left_n"], named["right_n"] = finger_sides(columns.fingers, scalars)
    return evolve(
        columns,
        lines=None,
        scalars=scalars,
        arrays={name: along(name, values) for name, values in columns.arrays.items()},
        notes=(*columns.notes, f"resampled to {rate_hz:g} Hz"),
        **named,
    )
