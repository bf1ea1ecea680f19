"""Traces and recordings with known answers, for tests."""

from math import nan

import numpy as np

from graspsense.core.values.signals import NO_PADS, Frame, Phase, Reading
from graspsense.core.values.trace import trace_of
from graspsense.recording.replayable import Recording


def made_recording(rate_hz, t_s, gap_m, left_n, right_n, **more):
    """A recording of these columns, without effort and pads."""
    columns = (np.asarray(column, float).tolist() for column in (t_s, gap_m, left_n, right_n))
    readings = tuple(
        Reading(Frame(t, 1.0 / rate_hz, gap, 0.0, nan, left, right, nan, nan, 0), NO_PADS)
        for t, gap, left, right in zip(*columns, strict=True)
    )
    return Recording(name="squeeze", rate_hz=rate_hz, readings=readings, **more)


def made_trace(rows, dt=0.001, phase=Phase.SQUEEZE, phases=None, units=None, t_s=None):
    """A trace of rows (gap_m, left_n, right_n), one a tick of `dt`, or at these times; other channels are 0."""
    rows = np.asarray(list(rows), dtype=float).reshape(-1, 3).tolist()
    times = [k * dt for k in range(len(rows))] if t_s is None else np.asarray(t_s, float).tolist()
    frames = [
        Frame(t, dt, gap, 0.0, 0.0, left, right, 0.0, 0.0, 0)
        for t, (gap, left, right) in zip(times, rows, strict=True)
    ]
    phases = [int(phase)] * len(frames) if phases is None else [int(p) for p in phases]
    arguments = (frames, phases, [0.0] * len(frames), [])
    return trace_of(*arguments) if units is None else trace_of(*arguments, units)
