"""Values with times of their own: the last of them in each tick, and samples as blocks of a fast channel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from graspsense.core.values.signals import Samples

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.values.channel import FastChannel


T = TypeVar("T")


def latest_values(
    times: NDArray[np.float64], sampled_s: NDArray[np.float64], values: Sequence[T], nothing: T
) -> list[T]:
    """Return the last of the values in each tick; `nothing` before the first."""
    counts = np.searchsorted(sampled_s, times, side="right").tolist()
    return [values[count - 1] if count else nothing for count in counts]


def most_in_a_tick(times: NDArray[np.float64], sampled_s: Sequence[float] | NDArray[np.float64]) -> int:
    """Return the largest number of samples that are new in one tick."""
    return int(np.diff(np.searchsorted(sampled_s, times, side="right"), prepend=0).max(initial=0))


def sample_blocks(
    times: NDArray[np.float64],
    sampled_s: NDArray[np.float64],
    values: NDArray[np.float64],
    channel: FastChannel,
) -> list[Samples]:
    """Return the samples that are new in each tick, at most as many as the channel declares.

    `times` are those of the ticks (s), `sampled_s` those of the samples, in increasing order; `values` has shape
    (samples, axes). A sample is delivered in the first tick that is not before it, or later where a tick has too many.
    """
    none = (float("nan"),) * len(channel.axes)
    blocks, done = [], 0
    for there in np.searchsorted(sampled_s, times, side="right").tolist():
        new = min(there - done, channel.samples)
        done += new
        rows = [tuple(row) for row in values[done - new : done].tolist()]
        t_s = float(sampled_s[done - 1]) if done else 0.0
        blocks.append(Samples(t_s, done, new, (*rows, *[none] * (channel.samples - new))))
    return blocks
