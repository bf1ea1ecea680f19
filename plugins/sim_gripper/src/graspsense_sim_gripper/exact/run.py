"""Ticks in which the plant stays in one mode: the state remains in the workspace from tick to tick.

`propagate` writes the named tuples of the plant into the workspace at the beginning of a tick, and reads them back at
its end. In a run of ticks without an event that is done once, before and after it. The results are the same to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from graspsense_sim_gripper.dynamics.state import Motion, PlantState, StepState
from graspsense_sim_gripper.exact.modes import FIRST_GUARD, FORCE, Shape
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

NO_RUN: Final = -1
"""As the index of a mode: `propagate` takes the next tick."""


class Run(NamedTuple):
    """The state of a run between two ticks, in addition to the state vector X0."""

    index: int
    """The index of the mode, which stays the same; NO_RUN if there is none."""
    mode: Mode
    motion: Motion
    force_n: float
    """The force on a pad."""
    closure_m: float
    """The closure at the end of the last tick, as it was computed."""
    touched: int
    peak_n: float


def begin_run(params: ExactPlant, plant: PlantState, effort_n: float) -> Run:
    """Write the state of the plant to X0, and return the run that begins there."""
    contact, motion = plant.contact, plant.motion
    mode = load(params, plant, effort_n)
    index = NO_RUN
    if is_centred(contact) and motion.revolutions < params.plant.drive.open_rev:
        index = index_with_contacts(params, mode)
    return Run(index, mode, motion, contact.left.force_n, 0.0, contact.touched, plant.peak_n)


def run_tick(params: ExactPlant, run: Run, effort_n: float, dt: float) -> tuple[bool, Run]:
    """Return whether the plant stays in its mode for a tick under this effort (N), and the run after it.

    If it does not, the tick has changed neither X0 nor the run.
    """
    ws, tol = params.workspace, params.tables.guard_tol
    index, mode, motion, force, closure, touched, peak = run
    ws[X0 + N_STATES] = effort_n
    map_outputs(params.tables.outputs, index * OUTPUT_ROWS * N_COLUMNS, ws)
    for k in range(N_CONTACTS):
        # Within the tolerance a contact could count as open or closed.
        if not ws[Y0 + FIRST_GUARD + k] > tol[((index * N_GUARDS) & INDEX_MASK) + k]:
            return False, run
    if not keeps_mode(params, index, mode.at_rest, peak, dt):
        return False, run
    within, motion = moved(params, motion, False)
    peak = max(peak, ws[X1 + N_STATES + FORCE])
    force, closure = pad_force_n(ws, mode.compressed), ws[X1]
    if not (within and math.isfinite(force + motion.speed_rev_s)):
        return False, run
    touched = touched_after(params, mode.compressed, touched, False)
    for j in range(2, N_STATES):
        ws[X0 + j] = ws[X1 + j]
    after = load_motion(params, motion, force)
    if after.compressed != mode.compressed or after.motion != mode.motion:
        # The next tick begins in another mode.
        index = NO_RUN
    return True, Run(index, Mode(mode.compressed, mode.motion, after.contacts, after.at_rest), motion, force, closure, touched, peak)


def end_run(params: ExactPlant, plant: PlantState, run: Run, n_ticks: int) -> PlantState:
    """Return the plant after a run of ticks, given that before it."""
    ws = params.workspace
    for j in range(2, N_STATES):
        ws[X1 + j] = ws[X0 + j]
    ws[X1], ws[X1 + N_STATES + FORCE] = run.closure_m, run.force_n
    contact = store_contact(params, plant.contact, TickResult(run.mode.compressed, run.touched, run.peak_n, 0), False)
    next_s, n_steps, unresolved = plant.step
    effort_n = ws[X0 + N_STATES - 1] if LAGS == 1 else plant.effort_n
    return PlantState(run.motion, contact, StepState(next_s, n_steps + n_ticks, unresolved), effort_n, run.peak_n)
