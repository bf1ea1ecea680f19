"""The further channels of a grasp over time: curves of numbers, and curves and a spectrogram of each fast channel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.channel import Channel, FastChannel
from graspsense.core.values.errors import counted
from graspsense.core.values.fingers import fingers_of
from graspsense.core.values.trace import Floats, SampleTrace, Trace
from graspsense.core.values.units import display_unit, without_underscores
from graspsense.report.heat import HeatScale, heat_rows
from graspsense.report.html import figure
from graspsense.report.moments import contact_time, shown_from
from graspsense.report.svg import DASHES, INKS, AxisScale, Picture, number, reaching

INTERVALS: Final = 150
"""A curve is drawn by the least and the greatest value of so many intervals, so that no peak is lost."""
LEAST_SAMPLES: Final = 64
"""A fast channel with fewer samples has no spectrogram."""
COLUMNS: Final = 90
"""Largest number of windows of a spectrogram that are drawn, and of its frequencies."""
FREQUENCIES: Final = 32
RANGE_DB: Final = 60.0
"""A spectrogram shows power down to so much below its maximum."""


def channel_figures(trace: Trace, channels: Sequence[Channel]) -> list[str]:
    """Return a figure of the forces of all fingers, one for each other number a tick, and one for each fast channel."""
    declared = {channel.name: channel for channel in channels}
    drawn: list[tuple[Channel, Floats, Mapping[str, Floats], int]] = []
    fingers = {
        finger.name: finger
        for finger in fingers_of(channels)
        if isinstance(trace.signals.get(finger.name), np.ndarray)
    }
    if fingers:
        lines = {without_underscores(finger.finger): trace.signals[name] for name, finger in fingers.items()}
        channel = Channel("forces_of_the_fingers", next(iter(fingers.values())).unit)
        drawn.append((channel, trace.t_s, lines, 0))
    for name, signal in trace.signals.items():
        channel = declared.get(name) or Channel(name, "unknown")
        if isinstance(signal, np.ndarray) and name not in fingers:
            drawn.append((channel, trace.t_s, {"": signal}, 0))
        elif isinstance(signal, SampleTrace) and len(signal.t_s):
            axes = channel.axes if isinstance(channel, FastChannel) else ()
            if len(axes) != signal.values.shape[1]:
                axes = tuple(f"axis {k}" for k in range(signal.values.shape[1]))
            drawn.append((channel, signal.t_s, dict(zip(axes, signal.values.T, strict=True)), signal.lost))
    figures = (_figure(trace, *channel_drawn) for channel_drawn in drawn)
    return [figure_drawn for figure_drawn in figures if figure_drawn]


def _figure(trace: Trace, channel: Channel, t: Floats, lines: Mapping[str, Floats], lost: int) -> str:
    """Return curves over time from shortly before contact on; empty if there is nothing to draw."""
    contact = contact_time(trace)
    shown = t >= (trace.t_s[shown_from(trace)] if len(trace) else 0.0)
    zero = contact if contact is not None else (trace.t_s[0] if len(trace) else 0.0)
    t, lines = t[shown] - zero, {axis: line[shown] for axis, line in lines.items()}
    unit, factor = display_unit(channel.unit)
    time = "seconds" if trace.units["t"] == "s" else trace.units["t"]
    known = [factor * line[np.isfinite(line)] for line in lines.values()]
    every = np.concatenate(known) if known else np.empty(0)
    title = without_underscores(channel.name)
    if len(t) < 2 or not len(every):
        return ""
    picture = Picture(0.0)
    picture.title(title)
    x_scale = AxisScale(float(t[0]), float(t[-1]), 42, picture.width - 10)
    y_scale = reaching([float(every.min()), float(every.max())], 150, 44)
    when = f"{time} since the squeeze began" if contact is not None else time
    with picture.axes(x_scale, y_scale, when, unit):
        for k, (axis, line) in enumerate(lines.items()):
            points = [(x_scale(t_s), y_scale(factor * value)) for t_s, value in envelope(t, line)]
            picture.line(
                points,
                INKS[k % len(INKS)],
                width=1.0,
                dash=DASHES[k % len(DASHES)],
                name=f"{axis} {unit}".strip(),
            )
    height = 184.0
    caption = f"{title[0].upper()}{title[1:]}, in {unit}"
    if len(lines) > 1:
        height += 12.0
        for k, axis in enumerate(lines):
            x = 42 + 70.0 * (k % 4)
            y = height + 15.0 * (k // 4) + 4
            picture.line(
                [(x, y - 4), (x + 18, y - 4)], INKS[k % len(INKS)], width=2, dash=DASHES[k % len(DASHES)]
            )
            picture.text(x + 22, y, axis)
        height += 15.0 * ((len(lines) + 3) // 4)
    words = f"{title} over time, from {number(float(every.min()))} to {number(float(every.max()))} {unit}"
    if isinstance(channel, FastChannel):
        drawn = _draw_spectrogram(picture, x_scale, t, lines, height + 22.0, trace.units["t"] == "s")
        if drawn:
            height, strongest = drawn
            words += f"; strongest at {number(strongest)} Hz"
            over = f", power summed over {', '.join(lines)}" if len(lines) > 1 else ""
            caption += f", and its spectrogram{over}: decibels relative to the maximum"
    if lost:
        caption += f"; {counted(lost, 'sample was', 'samples were')} lost"
    picture.height = height + 4.0
    return figure(picture.svg(words, trace.units["t"]), f"{caption}.")


def envelope(t: Floats, values: Floats) -> list[tuple[float, float]]:
    """Return the points of a curve: all, or of many the least and the greatest value of each interval."""
    finite = np.isfinite(values)
    t, values = t[finite], values[finite]
    if len(t) <= 2 * INTERVALS:
        return list(zip(t.tolist(), values.tolist(), strict=True))
    points = []
    for part in np.array_split(np.arange(len(t)), INTERVALS):
        for k in sorted({int(part[values[part].argmin()]), int(part[values[part].argmax()])}):
            points.append((float(t[k]), float(values[k])))
    return points


def spectrogram(
    t: Floats, lines: Mapping[str, Floats]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Return times, frequencies (Hz) and power (frequencies, times) in decibels relative to the maximum.

    The power is summed over the axes. Samples are taken as equally spaced. None where there are too few samples, a
    value is missing, or nothing but a constant.
    """
    from scipy.signal import spectrogram as power_over_time

    values = np.array(list(lines.values()))
    n = values.shape[1]
    if n < LEAST_SAMPLES or not np.isfinite(values).all() or not t[-1] > t[0]:
        return None
    rate_hz = (n - 1) / float(t[-1] - t[0])
    window = 1 << max(4, min(8, int(np.log2(n / 8))))
    frequencies, times, power = power_over_time(values, fs=rate_hz, nperseg=window, noverlap=window // 2)
    total = power.sum(axis=0)
    if not total.max() > 0.0:
        return None
    decibels = 10.0 * np.log10(np.maximum(total / total.max(), 1e-12))
    return float(t[0]) + times, frequencies, decibels


def _draw_spectrogram(
    picture: Picture,
    x_scale: AxisScale,
    t: Floats,
    lines: Mapping[str, Floats],
    top: float,
    in_seconds: bool,
) -> tuple[float, float] | None:
    """Draw the spectrogram below `top`; return where it ends, and the frequency with the most power."""
    result = spectrogram(t, lines) if in_seconds else None
    if result is None:
        return None
    times, frequencies, decibels = result
    strongest = float(frequencies[int(np.argmax(decibels.max(axis=1)))])
    # The largest value of neighbours stands for them, so that short events stay visible.
    fine_t, fine_f = (min(len(times), COLUMNS), min(len(frequencies), FREQUENCIES))
    coarse = np.array(
        [
            [block.max() for block in np.array_split(rows, fine_t, axis=1)]
            for rows in np.array_split(decibels, fine_f, axis=0)
        ]
    )
    scale = HeatScale(max(-RANGE_DB, float(coarse.min()) - 1e-9), 0.0, "dB")
    bottom = top + 100.0
    f_scale = AxisScale(0.0, float(frequencies[-1]), bottom, top)
    half = 0.5 * float(times[1] - times[0]) if len(times) > 1 else 0.0
    left, right = x_scale(float(times[0]) - half), x_scale(float(times[-1]) + half)
    levels = np.vectorize(scale.level)(coarse)[::-1]
    heat_rows(picture, levels, left, top, right - left, bottom - top)
    picture.x_axis(x_scale, bottom, bottom, "")
    picture.y_axis(f_scale, x_scale.start, x_scale.start, "frequency, Hz")
    scale.legend(picture, x_scale.start, bottom + 26.0, 200.0)
    return bottom + 54.0, strongest
