"""Preparing a recorded squeeze: where contact, hold and release are, and which force was measured when.

A force of the pads is taken at the time of its image, not at the ticks that repeat it: taken at the ticks, it would lag
behind the gap by up to a period, which makes a fast branch look stiffer and slower than it is.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError, Trace
from graspsense.simulator_api import RecordedSqueeze

Floats = NDArray[np.float64]

MAX_NODES: Final = 320
"""Nodes of the path of a squeeze, besides the times of the samples."""
LEAST_NODES: Final = 120
MAX_SAMPLES: Final = 160
"""Samples of the force of a squeeze; more are averaged in blocks."""
LEAST_SAMPLES: Final = 50
MANY: Final = 10
"""With more squeezes than these, each has fewer nodes and samples, so that a fit takes no longer."""
CONTACT_SHARE: Final = 0.03
"""The share of the peak force above which the object counts as touched."""
NOISE_FACTOR: Final = 5.0
"""Multiple of the noise above which the object counts as touched."""
BENT: Final = 1.4826 / math.sqrt(6.0)
"""Standard deviation of white noise over the median second difference, to which a steady rise adds nothing."""
BEFORE_S: Final = 0.05
"""The path begins at least this long before the force exceeds the threshold."""
BEFORE_SHARE: Final = 0.8
"""And where the gap is wider by this share of the compression, which is more than a fit moves the contact."""
HOLD_SHARE: Final = 0.01
"""A gap that changes by less than this share of the compression is held."""
BREAK_SHARE: Final = 0.4
"""A force that falls by this share before the fingers open is a break of the object, if it falls between two
measurements, or within `BREAK_S` and `BREAK_TRAVEL`: a shell that snaps through falls along its compression, and a
memory
relaxes with time."""
BREAK_S: Final = 0.15
BREAK_TRAVEL: Final = 0.05
"""Share of the compression."""
OPENED_SHARE: Final = 0.01
"""Where the gap has opened by more than this share of the compression, the fingers release the object. What yields
under them lets them close: a damped object loses most of its force before they have opened by a tenth."""
MIN_SAMPLES: Final = 8
"""Fewer samples in contact determine nothing."""
MAX_LAG_S: Final = 0.1
"""The force lags behind the gap by at most this time more than the settings say, or precedes it by as much."""


class Stretches(NamedTuple):
    """What a squeeze consists of."""

    load_s: float
    """Duration of the compression."""
    hold_s: float
    """Longest time for which the gap was held under force."""
    speed_m_s: float
    """Median closing speed during the compression."""
    has_approach: bool
    """Whether the recording begins before the contact."""


@frozen(kw_only=True, eq=False)
class Squeeze:
    """A squeeze as the fit uses it: the path of the gap at nodes, and the force at some of them."""

    name: str
    instance: str
    sha256: str
    t_s: Floats
    gap_m: Floats
    sample: NDArray[np.int64]
    """Nodes at which the force was measured."""
    force_n: Floats
    """The force at these nodes: the mean of both pads."""
    width_m: float
    """The gap at contact, as a first estimate."""
    stretches: Stretches
    pad_difference: float
    """The largest difference of the forces on both pads, over the largest mean force; 0 with a single pad."""
    broken_n: float | None = None
    """The force at the last node, right after the object broke, where the squeeze is cut; None if it did not break."""
    breaks_for_good: bool = False
    """Whether a later squeeze of the object, which is left out, shows that it broke."""
    course: tuple[Floats, Floats]
    """Times and gaps of the recording from `MAX_LAG_S` before the first node on."""

    def delayed(self, lag_s: float) -> Squeeze:
        """Return the squeeze if its force lagged behind the gap by so much: at every node, the gap of that time."""
        if lag_s == 0.0:
            return self
        return evolve(self, gap_m=np.interp(self.t_s - lag_s, *self.course))

    def only(self, is_kept: NDArray[np.bool_]) -> Squeeze:
        """Return the squeeze with some of its samples."""
        return evolve(self, sample=self.sample[is_kept], force_n=self.force_n[is_kept])

    @cached_property
    def speed_m_s(self) -> Floats:
        """The closing speed at the nodes."""
        return -np.gradient(self.gap_m, self.t_s)

    @cached_property
    def step_s(self) -> Floats:
        """The time since the node before."""
        return np.diff(self.t_s, prepend=self.t_s[0] - BEFORE_S)

    @cached_property
    def loading(self) -> slice:
        """The samples until the gap is smallest."""
        return slice(0, int(np.argmin(self.gap_m[self.sample])) + 1)

    def work_j(self, force_n: Floats) -> float:
        """Return the work of forces at the samples until the gap is smallest."""
        force, gap = force_n[self.loading], self.gap_m[self.sample][self.loading]
        return -float(np.sum(0.5 * (force[1:] + force[:-1]) * np.diff(gap)))

    def with_share(self, share: float) -> Squeeze:
        """Return the squeeze with the whole force, of which this share was measured."""
        broken_n = None if self.broken_n is None else self.broken_n / share
        return evolve(self, force_n=self.force_n / share, broken_n=broken_n)

    @cached_property
    def peak_n(self) -> float:
        """The largest force."""
        return float(np.max(self.force_n))

    @cached_property
    def depth_m(self) -> float:
        """The largest closure beyond the contact."""
        return float(self.width_m - np.min(self.gap_m))


class NoSqueeze(ConfigError):
    """A recording in which nothing, or too little, was squeezed."""


def prepared(
    squeeze: RecordedSqueeze,
    delay_s: float,
    lag_s: float = 0.0,
    *,
    squeezes: int = 1,
    may_break: bool = True,
) -> Squeeze:
    """Return the squeeze of a recording.

    `delay_s`: by how much a force without a time of its own lags behind the gap, by the settings of the sensor. The
    times of images contain this delay. `lag_s`: by how much every force lags beyond that. `squeezes`: how many are
    fitted together. `may_break`: whether the squeeze ends where the object seems to break.

    Raises ConfigError if it has no gap, no force, no contact, or too few samples in contact.
    """
    trace = squeeze.trace
    times, forces = _samples(squeeze.name, trace, delay_s, lag_s)
    peak = float(np.max(forces))
    threshold, touching = _contact(squeeze.name, forces, peak)
    onset = int(touching[0])
    begin = min(times[max(onset - 1, 0)] - BEFORE_S, _begin(trace, times[onset]))
    last, broken = int(touching[-1]), None
    if may_break:
        last, broken = _end(trace, times, forces, onset, last)
    window = (times >= begin) & (np.arange(len(times)) <= last)
    after = times[:0] if broken is None else times[broken : broken + 1]
    broken_n = None if broken is None else float(forces[broken])
    ends = float(times[window][0]), float(np.append(times[window], after)[-1])
    course = _smooth_course(trace, *ends)
    progress = _progress(course, *ends)
    touched = int(np.searchsorted(np.flatnonzero(window), onset))
    share = min(MANY / squeezes, 1.0)
    samples, pieces = max(int(share * MAX_SAMPLES), LEAST_SAMPLES), max(int(share * MAX_NODES), LEAST_NODES)
    times, forces = _in_blocks(times[window], forces[window], touched, progress, samples)
    nodes, sample = _nodes(np.append(times, after), progress, pieces)
    sample = sample[: len(times)]
    gap = np.interp(nodes, *course)
    width = float(np.interp(times[max(int(np.argmax(forces > threshold)) - 1, 0)], nodes, gap))
    return Squeeze(
        name=squeeze.name,
        instance=squeeze.instance,
        sha256=squeeze.sha256,
        t_s=nodes,
        gap_m=gap,
        sample=sample,
        force_n=forces,
        broken_n=broken_n,
        course=course,
        width_m=width,
        pad_difference=_pad_difference(trace, begin, float(times[-1])) / peak,
        stretches=_stretches(nodes, gap, width, has_approach=onset > 1),
    )


def _contact(name: str, forces: Floats, peak: float) -> tuple[float, NDArray[np.int64]]:
    """Return the force from which on the object counts as touched, and the samples beyond it. Raises NoSqueeze."""
    scatter = _noise(forces) if len(forces) > MIN_SAMPLES else 0.0
    onset = int(np.argmax(forces > CONTACT_SHARE * peak))
    # Noise beyond the share of the peak is no contact, and hides where the recording begins.
    noise = float(np.std(forces[: onset - 2])) if onset > 6 else scatter
    threshold = max(CONTACT_SHARE * peak, NOISE_FACTOR * noise)
    touching = np.flatnonzero(forces > threshold)
    if peak <= NOISE_FACTOR * scatter or not len(touching):
        raise NoSqueeze(f"{name}: no force exceeds the noise: nothing was touched")
    if len(touching) < MIN_SAMPLES:
        raise NoSqueeze(
            f"{name}: {len(touching)} measurements of the force in contact, and at least {MIN_SAMPLES} are "
            "needed: squeeze more slowly, or measure at a higher rate"
        )
    return threshold, touching


def _noise(forces: Floats) -> float:
    """Return the standard deviation of the noise of these forces."""
    return BENT * float(np.median(np.abs(np.diff(forces, 2))))


def _samples(name: str, trace: Trace, delay_s: float, lag_s: float) -> tuple[Floats, Floats]:
    """Return the times at which the force was measured, and the mean force of the pads. Raises ConfigError."""
    sides = [side for side in (trace.force_left_n, trace.force_right_n) if np.isfinite(side).any()]
    if not sides or not np.isfinite(trace.gap_m).any():
        missing = "force" if not sides else "gap"
        raise ConfigError(f"{name}: it has no {missing}, and a scene is identified from force and gap")
    force, times = np.mean(sides, axis=0), trace.t_s
    changed = np.flatnonzero(np.any([np.diff(side, prepend=np.nan) != 0.0 for side in sides], axis=0))
    images = trace.pad_t_s
    if len(images) > MIN_SAMPLES and len(changed) <= 1.3 * len(images) + 2:
        # Whatever its delay, an image has arrived when the next one is taken. The last one may still be on its way.
        images = images[images + delay_s <= times[-1] + 1e-9]
        shown = np.append(np.searchsorted(times, images[1:] - 1e-9), len(times)) - 1
        times, force, delay_s = images[shown >= 0], force[shown[shown >= 0]], 0.0
    elif len(changed) > MIN_SAMPLES and np.median(np.diff(changed)) > 1.5:
        # A force of a lower rate than the ticks, repeated between its samples. In a hold it may not change for long.
        times, force = times[changed], force[changed]
    finite = np.isfinite(force) & np.isfinite(times)
    return times[finite] - delay_s - lag_s, force[finite]


def _pad_difference(trace: Trace, begin_s: float, end_s: float) -> float:
    """Return the largest difference (N) of the forces on both pads between two times; 0 if one pad has none.

    It is that of means over a twentieth of the time, in which noise is none.
    """
    apart = (trace.force_left_n - trace.force_right_n)[(trace.t_s >= begin_s) & (trace.t_s <= end_s)]
    apart = apart[np.isfinite(apart)]
    width = 2 * (len(apart) // 40) + 1
    return float(np.max(np.abs(_moving_mean(apart, width)), initial=0.0)) if len(apart) else 0.0


def _progress(course: tuple[Floats, Floats], begin_s: float, end_s: float) -> tuple[Floats, Floats]:
    """Return times of a squeeze, and a measure from 0 to 1 that rises by half with the time and by half with the way of
    the fingers: nodes at equal distances in it are dense where the force changes, and follow a long hold too."""
    t = np.linspace(begin_s, end_s, MAX_NODES)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.interp(t, *course))))])
    return t, 0.5 * (t - t[0]) / (t[-1] - t[0]) + 0.5 * way / max(float(way[-1]), 1e-12)


def _begin(trace: Trace, touched_s: float) -> float:
    """Return the time before `touched_s` from which on the contact may lie: the fingers were further apart before.

    A force that rises slowly exceeds the threshold long after the contact.
    """
    approach = np.flatnonzero((trace.t_s <= touched_s) & np.isfinite(trace.gap_m))
    if not len(approach):
        return touched_s
    gap = trace.gap_m[approach]
    wider = np.flatnonzero(gap > gap[-1] + BEFORE_SHARE * (gap[-1] - float(np.nanmin(trace.gap_m))))
    return float(trace.t_s[approach[wider[-1] if len(wider) else 0]])


def _end(trace: Trace, times: Floats, forces: Floats, onset: int, last: int) -> tuple[int, int | None]:
    """Return the last sample of a squeeze, and the one after the break if the object broke there."""
    gap = np.interp(times, trace.t_s, trace.gap_m)
    depth = float(gap[onset]) - float(np.min(gap[onset : last + 1]))
    loaded = BREAK_SHARE * float(np.max(forces[onset : last + 1]))
    noise = _noise(forces)
    for i in range(onset + MIN_SAMPLES, last + 1):
        begin = min(int(np.searchsorted(times, times[i] - BREAK_S)), i - 1)
        peak = begin + int(np.argmax(forces[begin:i]))
        within = gap[peak] - gap[i] <= BREAK_TRAVEL * depth or i == peak + 1
        within = within and gap[i] - gap[peak] <= OPENED_SHARE * depth
        falls = forces[peak] - forces[i] > max(BREAK_SHARE * forces[peak], NOISE_FACTOR * noise)
        if falls and within and forces[peak] > loaded and peak >= onset + MIN_SAMPLES:
            return peak, i
    return last, None


def _in_blocks(
    times: Floats, values: Floats, touched: int, progress: tuple[Floats, Floats], samples: int
) -> tuple[Floats, Floats]:
    """Return times and values of about this number of means of neighbouring samples, evenly spaced in the progress.

    Those beside the contact, at the sample `touched`, stay single: the force of a damper jumps there, and the mean over
    a jump would be compared with that of a smooth course.
    """
    if len(times) <= samples:
        return times, values
    block = np.minimum(np.interp(times, *progress) * samples, samples - 1).astype(np.int64)
    beside = np.abs(block - block[touched]) <= 1
    edges = np.flatnonzero(beside | (np.diff(block, prepend=-1) > 0))
    counts = np.diff(edges, append=len(times))
    return np.add.reduceat(times, edges) / counts, np.add.reduceat(values, edges) / counts


def _nodes(times: Floats, progress: tuple[Floats, Floats], nodes: int) -> tuple[Floats, NDArray[np.int64]]:
    """Return the nodes of a path, and which of them are the times of the samples.

    Between two samples they are evenly spaced, so that no step is much shorter than those beside it.
    """
    pieces = np.ceil(np.diff(np.interp(times, *progress)) * nodes).astype(np.int64)
    pieces = np.maximum(pieces, 1)
    sample = np.concatenate([[0], np.cumsum(pieces)])
    return np.interp(np.arange(sample[-1] + 1), sample, times), sample


def _smooth_course(trace: Trace, begin_s: float, end_s: float) -> tuple[Floats, Floats]:
    """Return times and gaps around these two times, averaged over the ticks between two nodes."""
    known = np.isfinite(trace.gap_m)
    times, gap = trace.t_s[known], trace.gap_m[known]
    per_node = (end_s - begin_s) / MAX_NODES / max(float(np.median(np.diff(times))), 1e-9)
    width = 2 * int(per_node // 2) + 1
    if width > 1:
        # A mean flattens a curved course. What it takes away, a second mean takes away once more: it is added again.
        once = _moving_mean(gap, width)
        gap = 2.0 * once - _moving_mean(once, width)
    part = slice(
        max(int(np.searchsorted(times, begin_s - MAX_LAG_S)) - 1, 0),
        int(np.searchsorted(times, end_s + MAX_LAG_S)) + 2,
    )
    return times[part], gap[part]


def _moving_mean(values: Floats, width: int) -> Floats:
    padded = np.pad(values, width // 2, mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")


def _stretches(t_s: Floats, gap: Floats, width: float, *, has_approach: bool) -> Stretches:
    least = int(np.argmin(gap))
    depth = max(width - float(gap[least]), 1e-9)
    closing = np.flatnonzero((gap < width) & (gap > width - 0.95 * depth) & (np.arange(len(gap)) <= least))
    load_s = float(t_s[closing[-1]] - t_s[closing[0]]) if len(closing) > 1 else 0.0
    held = (
        np.abs(gap - float(np.median(gap[gap < width - (1.0 - 5 * HOLD_SHARE) * depth]))) < HOLD_SHARE * depth
    )
    changes = np.flatnonzero(np.diff(held.astype(np.int64), prepend=0, append=0))
    longest = float(np.max(t_s[changes[1::2] - 1] - t_s[changes[::2]], initial=0.0))
    return Stretches(
        load_s=load_s,
        hold_s=longest,
        speed_m_s=0.95 * depth / load_s if load_s > 0.0 else 0.0,
        has_approach=has_approach,
    )
