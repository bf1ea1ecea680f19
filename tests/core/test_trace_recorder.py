"""A trace that is read while its grasp goes on."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.values.signals import NO_PADS, SQUEEZE, VELOCITY, Command, Frame, Reading
from graspsense.core.values.trace import TraceRecorder


@given(st.lists(st.integers(1, 900), max_size=6))
def test_reading_the_ticks_so_far_changes_nothing_of_the_trace(parts):
    recorder, gaps = TraceRecorder(), []
    for count in parts:
        for _ in range(count):
            gaps.append(float(len(gaps)))
            frame = Frame(gaps[-1], 1e-3, gaps[-1], *[0.0] * 6, 0)
            recorder.add(Reading(frame, NO_PADS), SQUEEZE, Command(VELOCITY, 0.0, 1.0, 1.0))
        assert recorder.first_ticks(len(gaps) - 1, 0).gap_m.tolist() == gaps[:-1]
    trace = recorder.trace()
    assert np.array_equal(trace.gap_m, gaps)
    assert np.array_equal(trace.t_s, gaps)
