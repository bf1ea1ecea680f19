"""Traces with known answers, for tests."""

from graspsense.core.values.signals import Frame, Phase
from graspsense.core.values.trace import trace_of


def made_trace(rows, dt=0.001, phase=Phase.SQUEEZE, phases=None, units=None):
    """A trace of rows (gap_m, left_n, right_n), one a tick."""
    frames = [
        Frame(k * dt, dt, gap, 0.0, 0.0, left, right, 0.0, 0.0, 0)
        for k, (gap, left, right) in enumerate(rows)
    ]
    phases = [int(phase)] * len(frames) if phases is None else [int(p) for p in phases]
    arguments = (frames, phases, [0.0] * len(frames), [])
    return trace_of(*arguments) if units is None else trace_of(*arguments, units)
