"""Further channels in the ticks of a recording: the last of values with times of their own, images, and samples."""

from __future__ import annotations

from collections.abc import Sequence
from math import nan
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.channels import cells_of, no_signals, read_only, signal_type
from graspsense.core.values.channel import FLOATS, Channel, FastChannel, TactileArray
from graspsense.core.values.signals import Image, Samples
from graspsense.sources.formats.table import Numbers

T = TypeVar("T")


def latest_values(times: Numbers, sampled_s: Numbers, values: Sequence[T], nothing: T) -> list[T]:
    """Return the last of the values in each tick; `nothing` before the first."""
    counts = np.searchsorted(sampled_s, times, side="right").tolist()
    return [values[count - 1] if count else nothing for count in counts]


def signals_in_ticks(channels: Sequence[Channel], series: Sequence[Sequence[Any]], ticks: int) -> list[Any]:
    """Return the further signals of each tick, from the values of each channel in all of them."""
    if not channels:
        return [()] * ticks
    make = signal_type(channels)._make  # type: ignore[attr-defined]
    return list(map(make, zip(*series, strict=True)))


def values_in_ticks(
    times: Numbers, sampled_s: Numbers | None, values: NDArray[Any], channel: Channel
) -> list[Any]:
    """Return the value of a further channel in each tick, from what was sampled at `sampled_s`; None for each tick.

    Of a fast channel, a tick then has several samples. Those that are NaN at its end were not taken.
    """
    if isinstance(channel, FastChannel):
        if sampled_s is None:
            ticks = values.reshape(len(times), channel.samples, -1)
            taken = np.isfinite(ticks[:, ::-1]).any(axis=2).cumsum(axis=1)[:, ::-1] > 0
            sampled_s, values = np.repeat(times, taken.sum(axis=1)), ticks[taken]
        return sample_blocks(times, sampled_s, values, channel)
    nothing: Any = nan
    rows: list[Any]
    if isinstance(channel, TactileArray):
        if channel.dtype != FLOATS:
            values = read_only(values, channel.dtype)  # once, so that its images are passed by reference
        stamps = (times if sampled_s is None else sampled_s).tolist()
        images = enumerate(zip(stamps, values, strict=True), 1)
        rows = [Image(t_s, k, cells_of(channel, cells)) for k, (t_s, cells) in images]
        nothing = no_signals((channel,))[0]
    else:
        rows = values.tolist()
    return rows if sampled_s is None else latest_values(times, sampled_s, rows, nothing)


def most_in_a_tick(times: Numbers, sampled_s: Sequence[float] | Numbers) -> int:
    """Return the largest number of samples that are new in one tick."""
    return int(np.diff(np.searchsorted(sampled_s, times, side="right"), prepend=0).max(initial=0))


def sample_blocks(
    times: Numbers,
    sampled_s: Numbers,
    values: Numbers,
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
