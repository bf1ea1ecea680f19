"""Preparing a recorded squeeze: where contact, hold and release are, and which force was measured when.

A force of the pads is taken at the time of its image, not at the ticks that repeat it: taken at the ticks, it would lag
behind the gap by up to a period, which makes a fast branch look stiffer and slower than it is.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError, RecordedSqueeze, Trace

Floats = NDArray[np.float64]

MAX_NODES: Final = 320
"""Nodes of the path of a squeeze, besides the times of the samples."""
MAX_SAMPLES: Final = 240
"""Samples of the force of a squeeze; more are averaged in blocks."""
CONTACT_SHARE: Final = 0.03
"""The share of the peak force above which the object counts as touched."""
NOISE_FACTOR: Final = 5.0
"""Multiple of the noise above which the object counts as touched."""
BEFORE_S: Final = 0.05
"""Time before the contact at which the path begins."""
HOLD_SHARE: Final = 0.01
"""A gap that changes by less than this share of the compression is held."""
MIN_SAMPLES: Final = 8
"""Fewer samples in contact determine nothing."""


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
    has_release: bool
    """Whether it shows the object released."""


@frozen(kw_only=True, eq=False)
class Squeeze:
    """A squeeze as the fit uses it: the path of the gap at nodes, and the force at some of them."""

    name: str
    instance: str
    sha256: str
    t_s: Floats
    gap_m: Floats
    speed_m_s: Floats
    """Closing speed at the nodes."""
    step_s: Floats
    """Time since the node before."""
    sample: NDArray[np.int64]
    """Nodes at which the force was measured."""
    force_n: Floats
    """The force at these nodes: the mean of both pads, over `share`."""
    width_m: float
    """The gap at contact, as a first estimate."""
    noise_n: float
    """Standard deviation of the force before the contact."""
    stretches: Stretches
    share: float = 1.0
    """The share of the force that the pads measure."""

    @cached_property
    def measured_path(self) -> tuple[Floats, Floats]:
        """The measured force at every node, and its rate."""
        force = np.interp(self.t_s, self.t_s[self.sample], self.force_n)
        return force, np.gradient(force, self.t_s)

    @cached_property
    def peak_n(self) -> float:
        """The largest force."""
        return float(np.max(self.force_n))

    @cached_property
    def depth_m(self) -> float:
        """The largest closure beyond the contact."""
        return float(self.width_m - np.min(self.gap_m))


def prepared(squeeze: RecordedSqueeze, delay_s: float) -> Squeeze:
    """Return the squeeze of a recording; `delay_s`: from the time of an image until it arrives.

    Raises ConfigError if it has no gap, no force, no contact, or too few samples in contact.
    """
    trace = squeeze.trace
    times, forces = _samples(squeeze.name, trace, delay_s)
    peak = float(np.max(forces))
    first = int(np.argmax(forces > CONTACT_SHARE * peak))
    noise = float(np.std(forces[: max(first - 2, 0)])) if first > 6 else 0.0
    threshold = max(CONTACT_SHARE * peak, NOISE_FACTOR * noise)
    touching = np.flatnonzero(forces > threshold)
    if peak <= 0.0 or not len(touching):
        raise ConfigError(f"{squeeze.name}: no force exceeds the noise: nothing was touched")
    if len(touching) < MIN_SAMPLES:
        raise ConfigError(
            f"{squeeze.name}: {len(touching)} measurements of the force in contact, and at least {MIN_SAMPLES} are "
            "needed: squeeze more slowly, or measure at a higher rate"
        )
    first = int(touching[0])
    # The contact lies between the last sample without force and the first one with it.
    begin = times[max(first - 1, 0)] - BEFORE_S
    window = (times >= begin) & (times <= times[touching[-1]])
    times, forces = _in_blocks(times[window], forces[window], MAX_SAMPLES)
    nodes = np.union1d(np.linspace(times[0], times[-1], MAX_NODES), times)
    gap = _smooth_gap(trace, nodes)
    width = float(np.interp(times[max(int(np.argmax(forces > threshold)) - 1, 0)], nodes, gap))
    return Squeeze(
        name=squeeze.name,
        instance=squeeze.instance,
        sha256=squeeze.sha256,
        t_s=nodes,
        gap_m=gap,
        speed_m_s=-np.gradient(gap, nodes),
        step_s=np.diff(nodes, prepend=nodes[0] - BEFORE_S),
        sample=np.searchsorted(nodes, times),
        force_n=forces,
        width_m=width,
        noise_n=noise,
        stretches=_stretches(nodes, gap, width, has_approach=first > 1),
    )


def _samples(name: str, trace: Trace, delay_s: float) -> tuple[Floats, Floats]:
    """Return the times at which the force was measured, and the mean force of the pads. Raises ConfigError."""
    sides = [side for side in (trace.force_left_n, trace.force_right_n) if np.isfinite(side).any()]
    if not sides or not np.isfinite(trace.gap_m).any():
        missing = "force" if not sides else "gap"
        raise ConfigError(f"{name}: it has no {missing}, and a scene is identified from force and gap")
    force, times = np.mean(sides, axis=0), trace.t_s
    changed = np.flatnonzero(np.any([np.diff(side, prepend=np.nan) != 0.0 for side in sides], axis=0))
    images = trace.pad_t_s
    if len(images) > MIN_SAMPLES and len(changed) <= 1.3 * len(images) + 2:
        at = np.searchsorted(times, images + delay_s - 1e-9)
        known = at < len(times)
        times, force = images[known], force[at[known]]
    elif len(changed) > MIN_SAMPLES and np.median(np.diff(changed)) > 1.5:
        # A force of a lower rate than the ticks, repeated between its samples. In a hold it may not change for long.
        times, force = times[changed], force[changed]
    finite = np.isfinite(force) & np.isfinite(times)
    return times[finite], force[finite]


def _in_blocks(times: Floats, values: Floats, limit: int) -> tuple[Floats, Floats]:
    """Return at most `limit` means of neighbouring samples."""
    if len(times) <= limit:
        return times, values
    edges = np.linspace(0, len(times), limit + 1).astype(np.int64)
    counts = np.diff(edges)
    return np.add.reduceat(times, edges[:-1]) / counts, np.add.reduceat(values, edges[:-1]) / counts


def _smooth_gap(trace: Trace, nodes: Floats) -> Floats:
    """Return the gap at the nodes, averaged over the ticks between them."""
    known = np.isfinite(trace.gap_m)
    times, gap = trace.t_s[known], trace.gap_m[known]
    per_node = (nodes[-1] - nodes[0]) / MAX_NODES / max(float(np.median(np.diff(times))), 1e-9)
    width = 2 * int(per_node // 2) + 1
    if width > 1:
        padded = np.pad(gap, width // 2, mode="edge")
        gap = np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
    return np.interp(nodes, times, gap)


def _stretches(t_s: Floats, gap: Floats, width: float, *, has_approach: bool) -> Stretches:
    least = int(np.argmin(gap))
    depth = max(width - float(gap[least]), 1e-9)
    closing = np.flatnonzero((gap < width) & (gap > width - 0.95 * depth) & (np.arange(len(gap)) <= least))
    load_s = float(t_s[closing[-1]] - t_s[closing[0]]) if len(closing) > 1 else 0.0
    held = (
        np.abs(gap - float(np.median(gap[gap < width - (1.0 - 5 * HOLD_SHARE) * depth]))) < HOLD_SHARE * depth
    )
    longest, begin = 0.0, math.nan
    for i, is_held in enumerate(held):
        if is_held and math.isnan(begin):
            begin = float(t_s[i])
        elif not is_held:
            begin = math.nan
        if is_held:
            longest = max(longest, float(t_s[i]) - begin)
    return Stretches(
        load_s=load_s,
        hold_s=longest,
        speed_m_s=0.95 * depth / load_s if load_s > 0.0 else 0.0,
        has_approach=has_approach,
        has_release=bool(gap[-1] > width - 0.5 * depth),
    )
