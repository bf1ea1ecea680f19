"""What the samples of a channel show: rate, gaps, range, resolution, and how old a value gets."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import frozen

from graspsense.sources.formats.table import Numbers

_ROUNDING: Final = 1e-9
"""Share of the range of a channel below which the step between two values is one of rounding."""

GLITCHES: Final = 0.01
"""Share of the samples that can be glitches, at each end of the range."""


@frozen(kw_only=True)
class ChannelFacts:
    """What the samples of a channel show. Times are in s; those and the rate are None where no times are known."""

    name: str
    unit: str
    samples: int
    missing: int
    """Samples without a number."""
    low: float | None
    high: float | None
    """The range of its values; None if it has none."""
    resolution: float | None
    """The least step between two of its values, None if it has a single value."""
    rate_hz: float | None
    longest_gap_s: float | None
    """The longest time between two samples."""
    age_s: float | None
    """The longest time for which a value stays the same, or none comes: how old the value gets."""


def channel_facts(
    name: str, unit: str, values: Numbers, t_s: Numbers | None = None, end_s: float | None = None
) -> ChannelFacts:
    """Return the facts of a channel with the values (n,) or (n, k); `end_s` is when the recording ends."""
    known = values[np.isfinite(values)]
    gaps = np.diff(t_s) if t_s is not None and len(t_s) > 1 else None
    return ChannelFacts(
        name=name,
        unit=unit,
        samples=len(values),
        missing=int(len(values) - np.isfinite(values.reshape(len(values), -1)).all(axis=1).sum()),
        low=float(known.min()) if len(known) else None,
        high=float(known.max()) if len(known) else None,
        resolution=resolution(known),
        rate_hz=None if gaps is None or not np.median(gaps) > 0.0 else 1.0 / float(np.median(gaps)),
        longest_gap_s=None if gaps is None else float(gaps.max()),
        age_s=None if gaps is None or t_s is None else _age_s(values, t_s, end_s),
    )


def together(parts: Sequence[ChannelFacts]) -> ChannelFacts:
    """Return the facts of the same channel in several recordings: the extremes, and the median rate."""

    def known(name: str) -> list[float]:
        return [value for part in parts if (value := getattr(part, name)) is not None]

    rates = known("rate_hz")
    return ChannelFacts(
        name=parts[0].name,
        unit=parts[0].unit,
        samples=sum(part.samples for part in parts),
        missing=sum(part.missing for part in parts),
        low=min(known("low"), default=None),
        high=max(known("high"), default=None),
        resolution=min(known("resolution"), default=None),
        rate_hz=float(np.median(rates)) if rates else None,
        longest_gap_s=max(known("longest_gap_s"), default=None),
        age_s=max(known("age_s"), default=None),
    )


def resolution(known: Numbers) -> float | None:
    """Return the least step between two of these values that is none of rounding, None if there is a single value."""
    steps = np.diff(np.unique(known))
    steps = steps[steps > _ROUNDING * max(float(np.ptp(known)), 1e-300)] if len(steps) else steps
    return float(steps.min()) if len(steps) else None


def usual_range(values: Numbers) -> tuple[float, float]:
    """Return the least and the largest value, apart from one sample in a hundred at each end, which may be a glitch."""
    low = np.quantile(values, GLITCHES, method="higher")
    high = np.quantile(values, 1.0 - GLITCHES, method="lower")
    return float(low), float(high)


def period_s(t_s: Numbers, signal: Numbers) -> float:
    """Return the usual time (s) between two new values of a signal, infinite if it has none."""
    new = np.diff(t_s[np.flatnonzero(np.diff(signal))])
    return float(np.median(new)) if len(new) else np.inf


def _age_s(values: Numbers, t_s: Numbers, end_s: float | None) -> float:
    rows = values.reshape(len(values), -1)
    changed = (rows[1:] != rows[:-1]).any(axis=1)
    times = np.concatenate((t_s[:1], t_s[1:][changed], [t_s[-1] if end_s is None else max(end_s, t_s[-1])]))
    return float(np.diff(times).max())
