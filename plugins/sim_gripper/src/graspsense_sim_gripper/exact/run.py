"""A run of ticks in which the plant stays in one mode: its state remains in the workspace from tick to tick.

`propagate` writes the named tuples of the plant to the workspace at the beginning of a tick, and reads them back at its
end. In a run this is done once, before and after all of its ticks. The results are the same to the bit.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.dynamics.state import Motion, PlantState, StepState
from graspsense_sim_gripper.exact.modes import FIRST_GUARD, FORCE
from graspsense_sim_gripper.exact.propagate import (
    INDEX_MASK,
    LAGS,
    N_COLUMNS,
    N_CONTACTS,
    N_GUARDS,
    N_STATES,
    OUTPUT_ROWS,
    X0,
    X1,
    Y0,
    ExactPlant,
    Mode,
    TickResult,
    index_with_contacts,
    is_centred,
    keeps_mode,
    load,
    load_motion,
    map_outputs,
    moved,
    pad_force_n,
    store_contact,
    touched_after,
)

OTHER_MODE: Final = -1


class ExactRun(NamedTuple):
    """The state of a run between two ticks, in addition to the state vector X0."""

    mode_index: int
    """The index of the mode; OTHER_MODE if the next tick begins in another one."""
    mode: Mode
    """The mode, in which the closed contacts of terms are a guess."""
    motion: Motion
    force_n: float
    """The force on a pad."""
    closure_m: float
    """The closure of the fingers after the last tick. That in X0 is computed from the gap, and is rounded otherwise."""
    touched: int
    """As in `Contact`."""
    peak_n: float
    """The largest force on a pad in the grasp so far."""


def begin_run(params: ExactPlant, plant: PlantState, effort_n: float) -> tuple[bool, ExactRun]:
    """Write the state of the plant to X0; return whether exact discretisation applies to it, and the run from there."""
    contact, motion = plant.contact, plant.motion
    mode = load(params, plant, effort_n)
    index = index_with_contacts(params, mode)
    applies = is_centred(contact) and motion.revolutions < params.plant.drive.open_rev
    return applies, ExactRun(index, mode, motion, contact.left.force_n, 0.0, contact.touched, plant.peak_n)


def run_tick(params: ExactPlant, run: ExactRun, effort_n: float, dt: float) -> tuple[bool, ExactRun]:
    """Return whether the plant stays in its mode over a tick under this effort (N), and the run after the tick.

    If it does not, the run is unchanged, and so are the states in X0.
    """
    ws, tol = params.workspace, params.tables.guard_tol
    index, mode, motion, force, closure, touched, peak = run
    if index == OTHER_MODE:
        return False, run
    ws[X0 + N_STATES] = effort_n
    map_outputs(params.tables.outputs, index * OUTPUT_ROWS * N_COLUMNS, ws)
    for k in range(N_CONTACTS):
        # Within the tolerance, the contact could count as closed or as open.
        if not ws[Y0 + FIRST_GUARD + k] > tol[((index * N_GUARDS) & INDEX_MASK) + k]:
            return False, run
    if not keeps_mode(params, index, mode.at_rest, peak, dt):
        return False, run
    within, motion = moved(params, motion, False)
    force, closure = pad_force_n(ws, mode.compressed), ws[X1]
    if not within or not math.isfinite(force + motion.speed_rev_s):
        return False, run
    peak = max(peak, ws[X1 + N_STATES + FORCE])
    touched = touched_after(params, mode.compressed, touched, False)
    for j in range(2, N_STATES):
        ws[X0 + j] = ws[X1 + j]
    after = load_motion(params, motion, force)
    if after.compressed != mode.compressed or after.motion != mode.motion:
        index = OTHER_MODE
    return True, ExactRun(index, mode, motion, force, closure, touched, peak)


def end_run(params: ExactPlant, plant: PlantState, run: ExactRun, n_ticks: int) -> PlantState:
    """Return the plant after a run of this many ticks, at least one, given that before it."""
    ws = params.workspace
    # A tick that was not accepted has overwritten X1.
    for j in range(2, N_STATES):
        ws[X1 + j] = ws[X0 + j]
    ws[X1], ws[X1 + N_STATES + FORCE] = run.closure_m, run.force_n
    result = TickResult(run.mode.compressed, run.touched, run.peak_n, 0)
    contact = store_contact(params, plant.contact, result, False)
    next_s, n_steps, unresolved = plant.step
    effort_n = ws[X1 + N_STATES - 1] if LAGS == 1 else plant.effort_n
    step = StepState(next_s, n_steps + n_ticks, unresolved)
    return PlantState(run.motion, contact, step, effort_n, run.peak_n)
