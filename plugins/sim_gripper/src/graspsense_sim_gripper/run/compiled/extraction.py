"""Compiling what a feature set measures, so that a batch needs no trace for it."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final

import numpy as np

from graspsense.simulator_api import (
    CompiledExtraction,
    TickColumns,
    bind,
    compile_function,
    entry_point,
    is_on_disk,
)
from graspsense_sim_gripper.plant.object_model import unbound
from graspsense_sim_gripper.run.compiled.jit import generating
from graspsense_sim_gripper.run.loop import COLUMNS, EVENT_SHIFT, Table

PHASE_BITS: Final = (1 << EVENT_SHIFT) - 1


measure: Callable[[Any, TickColumns], Any] = unbound


def measure_buffers(params: Any, columns: Table, phases: Any, n: int) -> Any:
    """Return what is measured on the first `n` ticks of `Buffers`, from whose phases the events are left out."""
    without_events = np.empty(n, np.int64)
    for i in range(n):
        without_events[i] = phases[i] & PHASE_BITS
    ticks = TickColumns(
        t_s=columns[0][:n],
        gap_m=columns[1][:n],
        velocity_m_s=columns[2][:n],
        effort_n=columns[3][:n],
        force_left_n=columns[4][:n],
        force_right_n=columns[5][:n],
        edge_left_n=columns[6][:n],
        edge_right_n=columns[7][:n],
        command=columns[8][:n],
        phase=without_events,
    )
    return measure(params, ticks)


def is_measure_kept(form: CompiledExtraction) -> bool:
    """Return whether an earlier process has kept the machine code of an extraction on disk. Raises NotCompilable."""
    return is_on_disk(_measuring(form.measure))


def compiled_measure(form: CompiledExtraction) -> Callable[[Any, Any, Any, int], Any]:
    """Return `measure_buffers` of an extraction, compiled. Raises NotCompilable."""
    return _compiled_measure(form.measure, form.params)


@lru_cache(maxsize=16)
def _compiled_measure(
    what: Callable[[Any, TickColumns], Any], params: Any
) -> Callable[[Any, Any, Any, int], Any]:
    compiled = compile_function(_measuring(what))
    with generating():
        try:
            compiled(params, np.zeros((len(COLUMNS), 1)), np.zeros(1, np.int64), 0)
        except Exception:
            # It may raise where there are no ticks. Only if it has no code could it not be compiled.
            if not getattr(compiled, "overloads", {}):
                raise
    return entry_point(compiled)


def _measuring(what: Callable[[Any, TickColumns], Any]) -> Callable[..., Any]:
    return bind(measure_buffers, measure=what)
