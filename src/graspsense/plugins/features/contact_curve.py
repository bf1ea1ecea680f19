"""The force over compression and time of one grasp, from the contact to the end of the release.

Force and gap are functions of time, linear between samples. Everything else is an integral, a crossing or a regression
of these functions, so that the spacing of the samples has no weight. The force is the mean of the pads that give
numbers and reach the contact force; where only one pad does, it is the force of that one.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.gripper_api import NO_GAP
from graspsense.plugin_api import APPROACH, HOLD, RELEASE, Features, FeatureSet, Trace

Floats = NDArray[np.float64]

STAIRCASE: Final = 0.5
"""Share of the samples with a new force below which the others repeat the last one, as between two cell images."""
REPEATED: Final = 1.5
"""Multiple of the usual spacing of new forces after which an unchanged force counts as measured again."""
OPENED: Final = 0.5
"""Share of the compression by which the fingers must open, and of the largest force by which it must fall, for a
release that the phases do not tell.
"""
HELD: Final = 0.9
"""Share of its peak from which on a force is still that of a hold, where the gap was not recorded."""
STILL_CLOSED: Final = 0.02
"""Share of the compression by which the fingers may open before such a release begins."""
LOADED: Final = 0.95
"""Share of the largest force at which the loading ends; a plateau reaches the largest force itself by noise only."""
LEAST_SAMPLES: Final = 3
"""Fewest samples of a contact, and in a rise of the force that tell where in it the contact begins."""
UNRESOLVED: Final = "contact not resolved: fewer than three samples in the rise of the force"


Known = dict[str, float | str]
"""The value of each feature, or why it has none."""


def features_of(
    features: FeatureSet[Any], known: Known, trace: Trace, of_gap: Collection[str] = ()
) -> Features:
    """Return what is known of a trace as the features of a set; those `of_gap` are missing where it has no gap."""
    if trace.units.get("gap") == NO_GAP:
        known = known | {name: "no gap was recorded" for name in of_gap if not isinstance(known[name], str)}
    values = {name: value for name, value in known.items() if not isinstance(value, str)}
    reasons = {name: why for name, why in known.items() if isinstance(why, str)}
    return features.result(values, reasons, trace.units)


@frozen(kw_only=True, eq=False)
class CurveSamples:
    """The samples of a trace that have a gap and a force: arrays (n,); `pads` has a row for each pad that is used."""

    t_s: Floats
    gap_m: Floats
    pads: Floats
    phase: NDArray[np.int64]


def _samples_of(trace: Trace, contact_force_n: float) -> CurveSamples | str:
    """Return the samples of a trace, or why there are none.

    A pad that never feels the contact force (N) before the release is not used, unless no pad feels it.

    Where most forces repeat the last one, because the pads give an image only every so many ticks, the samples are
    those with a new force: a repeated force does not belong to the gap beside it.
    """
    usable = trace.phase >= APPROACH
    pads = [
        force
        for force in (trace.force_left_n, trace.force_right_n)
        if bool((np.isfinite(force) & usable).any())
    ]
    if not pads:
        return "the trace is empty" if len(trace) == 0 else "no pad gave a number"
    pads = [force for force in pads if bool(((force >= contact_force_n) & trace.closing).any())] or pads
    known = usable & np.isfinite(trace.gap_m) & np.isfinite(trace.t_s)
    for force in pads:
        known &= np.isfinite(force)
    ticks = np.flatnonzero(known)
    if not len(ticks):
        return "no sample has both a gap and a force"
    ticks = ticks[increasing(trace.t_s[ticks])]
    forces = np.array([force[ticks] for force in pads])
    new = _new_forces(trace.t_s[ticks], forces)
    ticks = ticks[new]
    return CurveSamples(
        t_s=trace.t_s[ticks], gap_m=trace.gap_m[ticks], pads=forces[:, new], phase=trace.phase[ticks]
    )


def increasing(t_s: Floats) -> NDArray[np.bool_]:
    """Return a mask of the times that are later than every one before them."""
    later = np.ones(len(t_s), dtype=np.bool_)
    later[1:] = t_s[1:] > np.maximum.accumulate(t_s[:-1])
    return later


def _new_forces(t_s: Floats, pads: Floats) -> NDArray[np.int64] | slice:
    """Return which samples have a new force; all where the forces are not repeated."""
    changed = (pads[:, 1:] != pads[:, :-1]).any(axis=0)
    if not len(changed) or np.count_nonzero(changed) < 2 or changed.mean() > STAIRCASE:
        return slice(None)
    new = np.concatenate(([0], np.flatnonzero(changed) + 1))
    since = t_s - t_s[new].repeat(np.diff(np.append(new, len(t_s))))
    return np.union1d(new, np.flatnonzero(since > REPEATED * np.median(np.diff(t_s[new]))))


@frozen(kw_only=True, eq=False)
class ContactCurve:
    """Compression and force of a grasp from the contact on, as functions of time.

    `t_s`, `compression_m`, `force_n` and `lowest_n` (of the pad with the smaller force) have shape (n,); `pads` has a
    row for each pad. The first sample is that at which the pads reached the contact force, by linear interpolation.
    The fingers hold or squeeze until `end_s`. The release follows if `released`; otherwise it is the end of the trace.
    """

    t_s: Floats
    compression_m: Floats
    force_n: Floats
    lowest_n: Floats
    pads: Floats
    samples: CurveSamples
    """All samples of the trace."""
    contact_gap_m: float
    end_s: float
    released: bool
    resolved: bool
    """Whether the samples in the rise of the force tell where in it the contact is."""
    impulse_n_s: Floats
    """The integral of the force over time from the contact on, at each sample."""
    work_j: Floats
    """The integral of the force over compression from the contact on, at each sample."""
    half_rise: Floats
    """Half of the rate of the force between each sample and the next, shape (n - 1,)."""
    velocity_m_s: Floats
    """The rate of the compression between each sample and the next, shape (n - 1,)."""

    def compression(self, t_s: float) -> float:
        """Return the compression (m) at a time."""
        return float(np.interp(t_s, self.t_s, self.compression_m))

    def mean_force(self, t_s: Floats, window_s: float) -> Floats:
        """Return the mean force (N) over a window around each of these times, cut off at the contact and at `end_s`."""
        low = np.maximum(t_s - 0.5 * window_s, self.t_s[0])
        high = np.minimum(t_s + 0.5 * window_s, self.end_s)
        duration = high - low
        mean = (self._integral(high) - self._integral(low)) / np.where(duration > 0.0, duration, 1.0)
        return np.where(duration > 0.0, mean, np.interp(t_s, self.t_s, self.force_n))

    def work(self, t_s: Floats) -> Floats:
        """Return the work (J) done on the object from the contact up to each of these times."""
        k, part = self._part(t_s)
        result: Floats = self.work_j[k] + self.velocity_m_s[k] * part
        return result

    def _integral(self, t_s: Floats) -> Floats:
        """Return the integral of the force over time, from the contact up to each of these times."""
        k, part = self._part(t_s)
        result: Floats = self.impulse_n_s[k] + part
        return result

    def _part(self, t_s: Floats) -> tuple[NDArray[np.int64], Floats]:
        """Return the last sample before each time, and the integral of the force, which is linear, from there on."""
        k = self.t_s[1:-1].searchsorted(t_s, side="right")
        since = t_s - self.t_s[k]
        return k, since * (self.force_n[k] + self.half_rise[k] * since)


def contact_curve(trace: Trace, contact_force_n: float) -> ContactCurve | str:
    """Return the curve of a trace from the contact on, or why there is no contact.

    Contact is the first time at which each pad feels the contact force (N) before the release.
    """
    samples = _samples_of(trace, contact_force_n)
    if isinstance(samples, str):
        return samples
    lowest = samples.pads.min(axis=0)
    touch = (lowest >= contact_force_n) & (samples.phase <= HOLD)
    if not touch.any():
        if len(samples.pads) == 1:
            return f"the pad never felt {contact_force_n:g} N"
        return f"the pads never felt {contact_force_n:g} N at the same time"
    contact = int(touch.argmax())
    t_s, gap = samples.t_s[contact:], samples.gap_m[contact:]
    pads, phase = samples.pads[:, contact:], samples.phase[contact:]
    between_samples = bool(contact and lowest[contact - 1] < contact_force_n < lowest[contact])
    if between_samples:
        # The contact is between two samples: where it is seen must not depend on their spacing.
        share = (contact_force_n - lowest[contact - 1]) / (lowest[contact] - lowest[contact - 1])
        seen_between = [
            column[..., contact - 1] + share * (column[..., contact] - column[..., contact - 1])
            for column in (samples.t_s, samples.gap_m, samples.pads)
        ]
        t_s, gap = np.concatenate(([seen_between[0]], t_s)), np.concatenate(([seen_between[1]], gap))
        pads = np.concatenate((seen_between[2][:, np.newaxis], pads), axis=1)
        phase = np.concatenate((phase[:1], phase))
    force = pads.mean(axis=0)
    compression = gap[0] - gap
    steps, travel = t_s[1:] - t_s[:-1], compression[1:] - compression[:-1]
    between = 0.5 * (force[1:] + force[:-1])
    start = _release(compression, force, phase)
    held = force[: len(force) if start is None else start + 1]
    loaded = int((held >= LOADED * held.max()).argmax())
    # Where the contact falls on a sample, the first step has no length.
    with np.errstate(divide="ignore", invalid="ignore"):
        half_rise, velocity = 0.5 * (force[1:] - force[:-1]) / steps, travel / steps
    return ContactCurve(
        t_s=t_s,
        compression_m=compression,
        force_n=force,
        lowest_n=pads.min(axis=0),
        pads=pads,
        samples=samples,
        contact_gap_m=float(gap[0]),
        end_s=float(t_s[-1] if start is None else t_s[start]),
        released=start is not None,
        # Neither is there a rise before a first sample, nor has one ended where little follows.
        resolved=not between_samples or loaded > LEAST_SAMPLES or len(held) < loaded + LEAST_SAMPLES,
        impulse_n_s=_summed(between * steps),
        work_j=_summed(between * travel),
        half_rise=half_rise,
        velocity_m_s=velocity,
    )


def _summed(parts: Floats) -> Floats:
    result = np.zeros(len(parts) + 1)
    np.cumsum(parts, out=result[1:])
    return result


def _release(compression: Floats, force: Floats, phase: NDArray[np.int64]) -> int | None:
    """Return the last sample before the release, or None.

    A recording has no phase of release: there it begins where the fingers open while the force falls, or, if the gap
    was not recorded, where the force begins to fall to half of its peak.
    """
    if bool((phase == RELEASE).any()):
        return max(int((phase == RELEASE).argmax()) - 1, 0)
    most, peak = int(compression.argmax()), float(force.max())
    travel = float(compression[most])
    open_again = (compression <= (1.0 - OPENED) * travel) & (force <= (1.0 - OPENED) * peak)
    open_again[: most + 1] = False
    if travel <= 0.0 and not compression.any():
        top = int(force.argmax())
        fallen = force[top:] <= (1.0 - OPENED) * peak
        held = np.flatnonzero(force[top : top + int(fallen.argmax())] >= HELD * peak)
        return top + int(held[-1]) if fallen.any() else None
    if travel <= 0.0 or not open_again.any():
        return None
    closed = np.flatnonzero(compression[: int(open_again.argmax())] >= (1.0 - STILL_CLOSED) * travel)
    return int(closed[-1])


def first_crossing(t_s: Floats, values: Floats, level: float) -> float | None:
    """Return the first time at which values, linear between samples, reach a level from below; None if never."""
    if not len(values):
        return None
    k = int((values >= level).argmax())
    if k == 0:
        return float(t_s[0]) if values[0] >= level else None
    low, high = values[k - 1], values[k]
    return float(t_s[k - 1] + (level - low) / (high - low) * (t_s[k] - t_s[k - 1]))
