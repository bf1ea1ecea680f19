"""The memory of kept traces: each has its own, and what is dropped is used again."""

import numpy as np

from graspsense_sim_gripper.batch.trace_memory import MAX_PAGES, PER_PAGE, TICKS, TraceMemory
from graspsense_sim_gripper.loop import COLUMNS


def test_traces_do_not_overlap():
    memory = TraceMemory()
    kept = [memory.arrays() for _ in range(3 * PER_PAGE + 1)]
    for k, (columns, phases) in enumerate(kept):
        assert columns.shape == (len(COLUMNS), TICKS)
        assert (phases.shape, phases.dtype) == ((TICKS,), np.int64)
        columns[:], phases[:] = k, k
    for k, (columns, phases) in enumerate(kept):
        assert (columns == k).all()
        assert (phases == k).all()


def test_memory_is_used_again_once_nothing_references_it():
    memory = TraceMemory()
    addresses = {memory.arrays()[0].ctypes.data for _ in range(20 * PER_PAGE)}
    assert len(addresses) <= 2 * PER_PAGE


def test_a_column_of_a_trace_keeps_its_memory():
    memory = TraceMemory()
    columns, phases = memory.arrays()
    columns[:], phases[:] = 7.0, 3
    part, phase = columns[4][:100], phases[10:20]
    del columns, phases
    for _ in range(2 * MAX_PAGES * PER_PAGE):
        other, numbers = memory.arrays()
        other[:], numbers[:] = 0.0, 0
    assert (part == 7.0).all()
    assert (phase == 3).all()
