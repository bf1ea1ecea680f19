"""Advancing the plant by one tick with precomputed matrix exponentials, and locating the events that end a mode.

`modes` defines the states x, the inputs u and the outputs. The workspace of a tick is one flat table that holds these
vectors at fixed offsets:

    X0     x and u at the beginning of a piece of the tick
    X1     x at the end of the piece, followed by the outputs there
    Y0     the outputs at the beginning of the piece
    BOUND  bounds on the change of the outputs within the tick
    DX     the change of x within the tick, projected as in `bounds`

The compiler can then tell that the vectors do not overlap, and keeps most numbers in registers. The names in capitals
and the matrix products are globals that `bind_move` replaces by constants and functions, so that every loop has a
constant length.

Events are located by bisection: a map for each duration tick / 2^k is precomputed, and a piece costs one product of a
matrix and a vector. The time-stepping schemes (`stepping`) have no such maps, and iterate on the solution of a step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import bind
from graspsense_sim_gripper.binding import bind_reachable
from graspsense_sim_gripper.dynamics.contact import RECOVERED_M
from graspsense_sim_gripper.dynamics.state import (
    Contact,
    ContactState,
    Halves,
    Motion,
    Past,
    PlantState,
    StepState,
)
from graspsense_sim_gripper.exact.expm import MAX_BISECTIONS
from graspsense_sim_gripper.exact.modes import (
    CLOSING,
    FIRST_GUARD,
    FORCE,
    FORCE_RATE,
    GAP_TOL_M,
    OPENING,
    STUCK,
    Shape,
)
from graspsense_sim_gripper.exact.tables import GROUP, Table, Tables, padded
from graspsense_sim_gripper.exact.term_states import term_state_functions
from graspsense_sim_gripper.stepping.scheme import PlantParams

INDEX_MASK: Final = 0x3FFFFFFF
"""After `&` with this mask the compiler knows that an index is not negative, and omits the check at each access."""
TICK_UNITS: Final = 1 << MAX_BISECTIONS
"""The length of a tick in units of the shortest piece, tick / 2^MAX_BISECTIONS."""
MAX_EVENTS: Final = 64
"""After this many events in a tick, the mode is kept to the end of the tick, and the step counts as unresolved."""
PEAK_TOL: Final = 2e-3
"""A maximum inside a tick that exceeds the peak force by less than this share of it may be missed."""
VECTORS: Final = ("X0", "X1", "Y0", "BOUND", "DX")
"""The vectors of the workspace, in their order."""


class ExactPlant(NamedTuple):
    """A plant with the matrices of its modes."""

    plant: PlantParams
    tables: Tables
    workspace: Table
    """`workspace_size` numbers that `move` overwrites in each tick."""


class Mode(NamedTuple):
    """The mode in which a piece of the tick begins."""

    compressed: int
    """1: the pads compress the object, or it is not separable; 0: it is separated from the pads."""
    motion: int
    """STUCK, CLOSING or OPENING."""
    contacts: int
    """A bit for each closed contact of a term."""
    at_rest: bool
    """Whether the speed is 0. It must then be checked whether friction holds the fingers."""


class TickResult(NamedTuple):
    """How a tick ended, in addition to the state vector X1."""

    compressed: int
    """As in `Mode`."""
    touched: int
    """As in `Contact`."""
    peak_n: float
    """The largest force on a pad (N) in the grasp so far."""
    n_events: int


# ------------------------------------------------------------------------------------------------------- binding


def bind_move(
    kinds: Sequence[str], shape: Shape, step_move: Callable[..., PlantState]
) -> Callable[[Any, PlantState, float, float], PlantState]:
    """Return `move` for an object with terms of these kinds and modes of this shape.

    `step_move` advances the plant by time steps in ticks to which exact discretisation does not apply.
    """
    bound_move: Callable[[Any, PlantState, float, float], PlantState] = bind_reachable(
        move, {**exact_parts(kinds, shape), "step_move": step_move}
    )
    return bound_move


def exact_parts(kinds: Sequence[str], shape: Shape) -> dict[str, Any]:
    """Return what the functions of this module read for an object with terms of these kinds and modes of this shape."""
    constants = _constants(shape)
    n, n_outputs = shape.n_states, padded(FIRST_GUARD + shape.n_guards)
    x0, x1, y0, bound, dx = (constants[name] for name in VECTORS)
    change = {"COLUMNS": n, "FROM": x1, "OF_CHANGE": 1, "X0": x0}
    products = {
        "map_step": bind(_product, ROWS=constants["MAP_ROWS"], COLUMNS=shape.n_columns, FROM=x0, TO=x1),
        "map_outputs": bind(_product, ROWS=n_outputs, COLUMNS=shape.n_columns, FROM=x0, TO=y0),
        "bound_directly": bind(_product, ROWS=n_outputs, TO=bound, OF_MAGNITUDE=1, **change),
        "project_change": bind(_product, ROWS=padded(2 * n), TO=dx, **change),
        "bound_by_modes": bind(_product, ROWS=n_outputs, COLUMNS=2 * n, FROM=dx, TO=bound, OF_MAGNITUDE=1),
    }
    pack, unpack = term_state_functions(kinds)
    # Only the products read DX.
    parts: dict[str, Any] = {name: place for name, place in constants.items() if name != "DX"}
    return parts | {**products, "pack": pack, "unpack": unpack}


def cold_calls(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names of the functions that `function`, a part of `move`, rarely calls.

    The compiler should not inline them, so that the registers remain for the frequent path.
    """
    code = function.__code__
    if code == move.__code__:
        return ("step_move",)
    return ("locate_events",) if code == propagate.__code__ else ()


def workspace_size(shape: Shape) -> int:
    """Return the number of entries of the workspace."""
    return len(VECTORS) * _vector_size(shape)


def _vector_size(shape: Shape) -> int:
    return padded(max(shape.n_columns, shape.n_states + FIRST_GUARD + shape.n_guards, 2 * shape.n_states))


def _constants(shape: Shape) -> dict[str, int]:
    """Return the values of the globals in capitals."""
    return {
        **{name.upper(): number for name, number in shape._asdict().items()},
        **{name: k * _vector_size(shape) for k, name in enumerate(VECTORS)},
        "OUTPUT_ROWS": padded(FIRST_GUARD + shape.n_guards),
        "MAP_ROWS": padded(shape.n_states + FIRST_GUARD + shape.n_guards),
        "PROJECTION_ROWS": padded(2 * shape.n_states),
        "TERM_STATES": 2 + shape.separable + 2 * shape.pad_states,
    }


# --------------------------------------------------------------------------------------------------------- a tick


def _no_steps(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    raise TypeError("no time-stepping plant is bound: use bind_move")


def _no_terms(*given: Any) -> Any:
    raise TypeError("no terms are bound: use bind_move")


step_move: Any = _no_steps
pack: Any = _no_terms
unpack: Any = _no_terms
N_STATES = N_COLUMNS = SEPARABLE = PAD_STATES = LAGS = N_MOTIONS = N_CONTACTS = N_GUARDS = 0
"""The fields of `Shape`."""
OUTPUT_ROWS = MAP_ROWS = PROJECTION_ROWS = 0
"""Rows of the tables, with the padding."""
TERM_STATES = 0
"""The index of the first state of a term in x."""
X0 = X1 = Y0 = BOUND = 0
ROWS = COLUMNS = FROM = TO = 0
"""Of a product: the shape of the matrix, and the offsets of its operand and result in the workspace."""
OF_CHANGE = OF_MAGNITUDE = 0
"""1: X0 is subtracted from the operand; 1: the magnitudes of the operand are taken."""


def _product(table: Table, at: int, ws: Table) -> None:
    """Write to TO the product of the matrix at index `at` of the table and the operand at FROM."""
    at &= INDEX_MASK
    for group in range(ROWS // GROUP):
        i = group * GROUP
        sum0 = sum1 = sum2 = sum3 = 0.0
        for j in range(COLUMNS):
            k, value = at + j * ROWS + i, ws[FROM + j]
            if OF_CHANGE == 1:
                value -= ws[X0 + j]
            if OF_MAGNITUDE == 1:
                value = abs(value)
            sum0 += table[k] * value
            sum1 += table[k + 1] * value
            sum2 += table[k + 2] * value
            sum3 += table[k + 3] * value
        i += TO
        ws[i], ws[i + 1], ws[i + 2], ws[i + 3] = sum0, sum1, sum2, sum3


map_step = map_outputs = bound_directly = project_change = bound_by_modes = _product


def _row_product(rows: Table, at: int, ws: Table) -> float:
    """Return the product of the row at index `at` and X0."""
    at &= INDEX_MASK
    total = 0.0
    for j in range(N_COLUMNS):
        total += rows[at + j] * ws[X0 + j]
    return total


def _mode_index(mode: Mode) -> int:
    """Return the index of a mode among `Layout.modes`. Without friction the motion is always STUCK, which is 0."""
    return ((mode.compressed * SEPARABLE * N_MOTIONS + mode.motion) << N_CONTACTS) + mode.contacts


def move(params: ExactPlant, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after a tick under this commanded effort (N).

    `dt` is the length of the tick (s) for which the matrices were computed.
    """
    linear, after = propagate(params, state, effort_n, dt)
    if not linear:
        return step_move(params.plant, state, effort_n, dt)  # type: ignore[no-any-return]
    return after


def propagate(params: ExactPlant, state: PlantState, effort_n: float, dt: float) -> tuple[bool, PlantState]:
    """Return whether exact discretisation applies to the tick, and the plant after it.

    It does not apply if the object is off the centre line, or if the fingers reach an end of their travel. In both
    cases the second value is not the plant after the tick. Fingers pushed against the open end are an exception: they
    stand still, as under an effort of 0, while the object recovers its shape.
    """
    contact, drive = state.contact, params.plant.drive
    at_open_end = state.motion.revolutions >= drive.open_rev and effort_n <= 0.0
    if not is_centred(contact) or (
        at_open_end and (LAGS == 1 or state.motion.speed_rev_s != 0.0 or contact.left.force_n > 0.0)
    ):
        return False, state
    mode = load(params, state, 0.0 if at_open_end else effort_n)
    if no_event(params, mode, state.peak_n, dt):
        peak_n = max(state.peak_n, params.workspace[X1 + N_STATES + FORCE])
        result = TickResult(mode.compressed, contact.touched, peak_n, 0)
    else:
        result = locate_events(params, mode, contact.touched, state.peak_n, dt)
    return _store(params, state, result, at_open_end)


def is_centred(contact: Contact) -> bool:
    """Return whether the object is on the centre line, both pads carry the same force, and no recovery is pending."""
    return contact.offset_m == 0.0 and contact.left_n == contact.right_n and not contact.pending_s > 0.0


def load(params: ExactPlant, state: PlantState, effort_n: float) -> Mode:
    """Write the state to X0, and return the mode. Its closed contacts of terms are a guess that the guards correct."""
    model, ws, left = params.plant.object, params.workspace, state.contact.left
    if SEPARABLE == 1:
        ws[X0 + 2] = left.compression_m
    if PAD_STATES == 1:
        ws[X0 + 3], ws[X0 + 4] = left.pad_m, left.branch_n
    pack(model.terms, left.states, ws, X0 + TERM_STATES)
    ws[X0 + N_STATES] = effort_n
    if LAGS == 1:
        ws[X0 + N_STATES - 1] = state.effort_n
    if N_MOTIONS == 3:
        ws[X0 + N_STATES + 1] = params.plant.drive.friction.coulomb_n
    return load_motion(params, state.motion, left.force_n)


def load_motion(params: ExactPlant, moved: Motion, force_n: float) -> Mode:
    """Write the motion to X0, where the other states are, and return the mode, given the force on a pad."""
    model, ws = params.plant.object, params.workspace
    closure = model.width_m - moved.gap_m
    ws[X0] = closure
    ws[X0 + 1] = -moved.speed_rev_s * moved.jacobian_m_rev
    compressed = 1
    if SEPARABLE == 1:
        pad = ws[X0 + 3] if PAD_STATES == 1 else 0.0
        if force_n <= 0.0 and closure - ws[X0 + 2] - pad < -GAP_TOL_M:
            compressed = 0
        elif model.pads.stiffness_n_m == math.inf:
            ws[X0 + 2] = closure
    motion = STUCK
    at_rest = ws[X0 + 1] == 0.0
    if N_MOTIONS == 3 and not at_rest:
        motion = CLOSING if ws[X0 + 1] > 0.0 else OPENING
    contacts = (1 << N_CONTACTS) - 1 if force_n > 0.0 else 0
    return Mode(compressed, motion, contacts, at_rest)


def _store(
    params: ExactPlant, state: PlantState, result: TickResult, at_open_end: bool
) -> tuple[bool, PlantState]:
    """Return whether the fingers are within their travel, and the plant with the state in X1."""
    within, motion = moved(params, state.motion, at_open_end)
    if not within:
        return False, state
    contact = store_contact(params, state.contact, result, at_open_end)
    unresolved = state.step.unresolved + (1 if result.n_events >= MAX_EVENTS else 0)
    step = StepState(state.step.next_s, state.step.n_steps + 1, unresolved)
    effort_n = params.workspace[X1 + N_STATES - 1] if LAGS == 1 else state.effort_n
    return True, PlantState(motion, contact, step, effort_n, result.peak_n)


def moved(params: ExactPlant, motion: Motion, at_open_end: bool) -> tuple[bool, Motion]:
    """Return whether the fingers are within their travel at X1, and their motion there; `motion`: that before."""
    drive, ws = params.plant.drive, params.workspace
    revolutions, _, gap, jacobian = motion
    closed_by = ws[X1] - (params.plant.object.width_m - gap)
    # The next tick depends on this, and a product is available sooner than a quotient.
    rev_per_m = 1.0 / jacobian
    revolutions1 = revolutions - closed_by * rev_per_m
    within = drive.closed_rev < revolutions1 < drive.open_rev or (at_open_end and closed_by == 0.0)
    return within, Motion(revolutions1, -ws[X1 + 1] * rev_per_m, gap - closed_by, jacobian)


def _both_same(right: Halves, left: ContactState) -> Halves:
    if len(right) == 0:
        return right
    return (left,)


def pad_force_n(ws: Table, compressed: int) -> float:
    """Return the force on a pad at X1 (N)."""
    # A mode that is entered at the very end of the tick has not acted yet.
    return max(ws[X1 + N_STATES + FORCE], 0.0) if compressed == 1 else 0.0


def touched_after(params: ExactPlant, compressed: int, touched: int, at_open_end: bool) -> int:
    """Return `Contact.touched` at X1, given that before."""
    ws = params.workspace
    if SEPARABLE == 0:
        return 1 if ws[X1] >= 0.0 else touched
    if compressed == 1:
        return 1
    pad_m = ws[X1 + 3] if PAD_STATES == 1 else 0.0
    in_shape = ws[X1] < 0.0 and abs(ws[X1 + 2]) + abs(pad_m) <= RECOVERED_M
    return 0 if in_shape and (not at_open_end or params.plant.object.overshoots == 0) else touched


def store_contact(params: ExactPlant, contact: Contact, result: TickResult, at_open_end: bool) -> Contact:
    """Return the contact with the state of the object and the forces on the pads in X1."""
    model, ws, before = params.plant.object, params.workspace, contact.left
    force = pad_force_n(ws, result.compressed)
    touched = touched_after(params, result.compressed, result.touched, at_open_end)
    pad_m, branch_n = before.pad_m, before.branch_n
    if PAD_STATES == 1:
        pad_m, branch_n = ws[X1 + 3], ws[X1 + 4]
    compression = ws[X1] if touched == 1 else 0.0
    if SEPARABLE == 1:
        compression = ws[X1 + 2]
    states, _ = unpack(model.terms, before.states, ws, X1 + TERM_STATES)
    left = ContactState(
        compression,
        force,
        before.slope_n_m,
        states,
        pad_m,
        branch_n,
        Past(before.past.rate_m_s, 0.0, math.inf, math.inf),
    )
    # An object that is held on the centre line has two halves in the same state.
    right = _both_same(contact.right, left)
    return Contact(force, force, contact.offset_m, touched, left, right, 0.0, contact.unbalanced)


# --------------------------------------------------------------------------------------------------------- events


def no_event(params: ExactPlant, mode: Mode, peak_n: float, dt: float) -> bool:
    """Write the state after the tick to X1, and return whether it is valid because no event ends the mode before.

    This is the frequent case. The result is also False if the force may exceed `peak_n` inside the tick but not at its
    ends.
    """
    index = index_with_contacts(params, mode)
    return keeps_mode(params, index, mode.at_rest, peak_n, dt)


def index_with_contacts(params: ExactPlant, mode: Mode) -> int:
    """Return the index of the mode with the contacts of terms that are closed in X0, and write its outputs to Y0."""
    tables, ws = params.tables, params.workspace
    tol, index = tables.guard_tol, _mode_index(mode)
    for _ in range(2):
        map_outputs(tables.outputs, index * OUTPUT_ROWS * N_COLUMNS, ws)
        wrong = 0
        for k in range(N_CONTACTS):
            if ws[Y0 + FIRST_GUARD + k] < -tol[((index * N_GUARDS) & INDEX_MASK) + k]:
                wrong += 1 << k
        if wrong == 0:
            break
        index ^= wrong
    return index


def keeps_mode(params: ExactPlant, index: int, at_rest: bool, peak_n: float, dt: float) -> bool:
    """Do what `no_event` does, in the mode with this index, whose outputs are in Y0."""
    tables, ws = params.tables, params.workspace
    if N_MOTIONS == 3 and at_rest:
        for k in range(N_GUARDS - 2, N_GUARDS):
            if ws[Y0 + FIRST_GUARD + k] < -tables.guard_tol[((index * N_GUARDS) & INDEX_MASK) + k]:
                return False
    map_step(tables.maps, index * (MAX_BISECTIONS + 1) * MAP_ROWS * N_COLUMNS, ws)
    if _guard_violated(tables, index, ws):
        return False
    if tables.bisection_depth == 0:
        return not (ws[Y0 + FORCE_RATE] > 0.0 > ws[X1 + N_STATES + FORCE_RATE])
    return not _event_possible(params, index, peak_n, dt)


def _guard_violated(tables: Tables, index: int, ws: Table) -> bool:
    """Return whether a guard of the mode is negative in X1."""
    at = (index * N_GUARDS) & INDEX_MASK
    violated = False
    for k in range(N_GUARDS):
        if ws[X1 + N_STATES + FIRST_GUARD + k] < -tables.guard_tol[at + k]:
            violated = True
    return violated


def _event_possible(params: ExactPlant, index: int, peak_n: float, dt: float) -> bool:
    """Return whether, inside a tick, a guard may be negative or the force above `peak_n`, although not at its end.

    The outputs inside the tick differ from Y0 by no more than the bounds (see `bounds`). The direct bound is evaluated
    first, and the modal one only if the direct one does not exclude an event. The peak needs neither if the rates of
    the force at both ends agree with its mean rate: it does not oscillate in between then.
    """
    tables, ws = params.tables, params.workspace
    force0, force1 = ws[Y0 + FORCE], ws[X1 + N_STATES + FORCE]
    rise = force1 - force0
    uneven = max(abs(ws[Y0 + FORCE_RATE] * dt - rise), abs(ws[X1 + N_STATES + FORCE_RATE] * dt - rise))
    exceeded = (1.0 + PEAK_TOL) * max(peak_n, force1)
    peak_excluded = max(force0, force1) + uneven <= exceeded
    bound_directly(tables.direct_bound, index * OUTPUT_ROWS * N_STATES, ws)
    if _is_excluded(ws, peak_excluded, exceeded):
        return False
    project_change(tables.modal_projection, index * PROJECTION_ROWS * N_STATES, ws)
    bound_by_modes(tables.modal_bound, 2 * index * OUTPUT_ROWS * N_STATES, ws)
    return not _is_excluded(ws, peak_excluded, exceeded)


def _is_excluded(ws: Table, peak_excluded: bool, exceeded_n: float) -> bool:
    """Return whether the bounds exclude that a guard is negative, and that the force is above `exceeded_n`."""
    excluded = peak_excluded or ws[Y0 + FORCE] + ws[BOUND + FORCE] <= exceeded_n
    for k in range(N_GUARDS):
        # False for NaN too.
        if not ws[BOUND + FIRST_GUARD + k] <= ws[Y0 + FIRST_GUARD + k]:
            excluded = False
    return excluded


def locate_events(params: ExactPlant, mode: Mode, touched: int, peak_n: float, dt: float) -> TickResult:
    """Advance by a tick in pieces of dt / 2^level, switching modes at events. The state after it is in X0 and X1.

    The whole tick is tried first. If an event is possible in it, pieces of the bisection depth are tried in turn. A
    piece at whose end a guard is negative is halved, down to the shortest piece; the event lies at its end.
    """
    tables, ws, depth = params.tables, params.workspace, params.tables.bisection_depth
    remaining, level, n_events, until, index = TICK_UNITS, 0, 0, 0, 0
    entering = True
    while remaining > 0:
        if entering:
            mode = _enter(params, mode, n_events == 0)
            index = _mode_index(mode)
            entering = False
        while (TICK_UNITS >> level) > remaining:
            level += 1
        map_step(tables.maps, (index * (MAX_BISECTIONS + 1) + level) * MAP_ROWS * N_COLUMNS, ws)
        searching = n_events < MAX_EVENTS
        event = searching and _guard_violated(tables, index, ws)
        if level == 0 and depth > 0 and searching and (event or _event_possible(params, index, peak_n, dt)):
            level = depth
            continue
        if event and level < MAX_BISECTIONS:
            until = remaining - (TICK_UNITS >> level)
            level += 1
            continue
        peak_n = _piece_peak(params, level, peak_n, dt)
        remaining -= TICK_UNITS >> level
        for j in range(N_STATES):
            ws[X0 + j] = ws[X1 + j]
        if event:
            n_events += 1
            level = depth
            entering = True
            before = mode.compressed
            mode = _switch(params, mode, index)
            if mode.compressed > before:
                touched = 1
        elif remaining > 0:
            for j in range(FIRST_GUARD + N_GUARDS):
                ws[Y0 + j] = ws[X1 + N_STATES + j]
            if level > depth and searching:
                # The event that ended a longer piece lies in its second half.
                level = min(level + 1, MAX_BISECTIONS) if remaining > until else depth
    for j in range(N_STATES):
        ws[X1 + j] = ws[X0 + j]
    return TickResult(mode.compressed, touched, peak_n, n_events)


def _enter(params: ExactPlant, mode: Mode, first: bool) -> Mode:
    """Return the mode of the state in X0, and write its outputs to Y0.

    `first`: at the beginning of the tick, where the closed contacts of terms are a guess that is corrected here.
    Fingers at rest are stuck, unless a guard of that mode shows that the driving force exceeds friction.
    """
    tables, ws = params.tables, params.workspace
    compressed, motion, contacts, at_rest = mode
    consistent = False
    while not consistent:
        consistent = True
        index = _mode_index(Mode(compressed, motion, contacts, at_rest))
        at = (index * N_GUARDS) & INDEX_MASK
        map_outputs(tables.outputs, index * OUTPUT_ROWS * N_COLUMNS, ws)
        if first:
            for k in range(N_CONTACTS):
                if ws[Y0 + FIRST_GUARD + k] < -tables.guard_tol[at + k]:
                    contacts ^= 1 << k
                    consistent = False
        if N_MOTIONS == 3 and at_rest and consistent:
            at_rest = False
            if ws[Y0 + FIRST_GUARD + N_GUARDS - 2] < -tables.guard_tol[at + N_GUARDS - 2]:
                motion, consistent = CLOSING, False
            elif ws[Y0 + FIRST_GUARD + N_GUARDS - 1] < -tables.guard_tol[at + N_GUARDS - 1]:
                motion, consistent = OPENING, False
    return Mode(compressed, motion, contacts, at_rest)


def _switch(params: ExactPlant, mode: Mode, index: int) -> Mode:
    """Return the mode after the events at X1, and write to X0 what they change: δ and p by the reset map, or V to 0."""
    tables, ws = params.tables, params.workspace
    at = (index * N_GUARDS) & INDEX_MASK
    compressed, motion, contacts, at_rest = mode
    for k in range(N_GUARDS):
        if ws[X1 + N_STATES + FIRST_GUARD + k] < -tables.guard_tol[at + k]:
            if k < N_CONTACTS:
                contacts ^= 1 << k
            elif SEPARABLE == 1 and k == N_CONTACTS:
                compressed = 1 - compressed
            else:
                # The fingers stop, or friction no longer holds them: `_enter` determines in which direction they move.
                ws[X0 + 1] = 0.0
                motion, at_rest = STUCK, True
    if compressed != mode.compressed:
        entered = _mode_index(Mode(compressed, motion, contacts, at_rest))
        pad = _row_product(tables.reset_map, (2 * entered + 1) * N_COLUMNS, ws)
        ws[X0 + 2] = _row_product(tables.reset_map, 2 * entered * N_COLUMNS, ws)
        if PAD_STATES == 1:
            ws[X0 + 3] = pad
    return Mode(compressed, motion, contacts, at_rest)


# ------------------------------------------------------------------------------------------------------ peak force


def _piece_peak(params: ExactPlant, level: int, peak_n: float, dt: float) -> float:
    """Return the peak force (N) of the grasp after a piece of the tick, from Y0 to X1."""
    ws = params.workspace
    force1, rate1 = ws[X1 + N_STATES + FORCE], ws[X1 + N_STATES + FORCE_RATE]
    if force1 > peak_n:
        peak_n = force1
    if ws[Y0 + FORCE_RATE] > 0.0 and rate1 < 0.0 and level >= params.tables.bisection_depth:
        h = math.ldexp(dt, -level)
        peak_n = max(peak_n, _cubic_peak(ws[Y0 + FORCE], ws[Y0 + FORCE_RATE], force1, rate1, h))
    return peak_n


def _cubic_peak(force0: float, rate0: float, force1: float, rate1: float, h: float) -> float:
    """Return the maximum of the cubic Hermite polynomial over `h` (s) with these values and slopes at its ends.

    It is limited to the tangent at each end, evaluated at the other end: a concave force does not exceed either.
    """
    step = force1 - force0
    m0, m1 = rate0 * h, rate1 * h
    a, b = 3.0 * (m0 + m1 - 2.0 * step), 2.0 * (3.0 * step - 2.0 * m0 - m1)
    s = 2.0 * m0 / (math.sqrt(max(b * b - 4.0 * a * m0, 0.0)) - b)
    limit = min(force0 + m0, force1 - m1)
    return min(force0 + s * (m0 + s * (3.0 * step - 2.0 * m0 - m1 + s * (m0 + m1 - 2.0 * step))), limit)
