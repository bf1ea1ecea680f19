"""Frames that come in tables give the trace that the same frames give one by one."""

from __future__ import annotations

import numpy as np
from attrs import fields
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.values.signals import NO_PADS, SQUEEZE, VELOCITY, Command, Frame, Reading
from graspsense.core.values.trace import FrameTable, Trace, TraceRecorder


@given(st.lists(st.tuples(st.sampled_from(["ticks", "frames", "table"]), st.integers(1, 600)), max_size=4))
def test_a_trace_depends_on_the_frames_alone(parts):
    plain, mixed = TraceRecorder(), TraceRecorder()
    begun = 0
    for kind, count in parts:
        numbers = np.arange(begun * 10, (begun + count) * 10, dtype=float).reshape(count, 10)
        frames = [Frame(*row[:9], int(row[9])) for row in numbers.tolist()]
        commands = [frame.gap_m / 2.0 for frame in frames]
        begun += count
        for recorder in (plain, mixed):
            if kind == "ticks" or recorder is plain:
                for frame, value in zip(frames, commands, strict=True):
                    recorder.add(Reading(frame, NO_PADS), SQUEEZE, Command(VELOCITY, value, 1.0, 1.0))
            else:
                table = FrameTable(numbers)
                assert list(table) == frames
                recorder.extend(table if kind == "table" else frames, SQUEEZE, commands)
        # A reader may convert a part while the grasp goes on.
        shown = mixed.first_ticks(begun - 1, 0)
        assert shown.gap_m.tolist() == plain.first_ticks(begun - 1, 0).gap_m.tolist()
    expected, trace = plain.trace(), mixed.trace()
    for field in fields(Trace):
        assert np.array_equal(getattr(trace, field.name), getattr(expected, field.name))
