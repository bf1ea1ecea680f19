"""The whole trace of an imported recording, also after the end that a controller saw."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve

from graspsense.core.values.signals import APPROACH

if TYPE_CHECKING:
    from graspsense.core.values.trace import Trace


def with_phases_of(whole: Trace, replayed: Trace) -> Trace:
    """Return the whole trace with the phases of a replay, of which the last one holds after its end.

    A controller that saw a rest, or a failure, ends a replay before the recording does.
    """
    phases = replayed.phase[: len(whole)]
    last = int(phases[-1]) if len(phases) else APPROACH
    held = np.full(len(whole) - len(phases), last, dtype=np.int64)
    return evolve(whole, phase=np.concatenate((phases, held)), events=replayed.events)
