"""The ticks of a phase at once, compiled: the steps of MuJoCo, the measurement, and the controller in between.

`MujocoGripper` and the runner compute the same in the interpreter, which takes twice as long as MuJoCo with a rigid
thing. The laws of the drive, the contacts, the controller and the guard are the same functions.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from math import inf, nan
from typing import Any, NamedTuple

from graspsense.plugin_api import EFFORT, Command, Frame, Pads, Reading
from graspsense.simulator_api import (
    CompileOptions,
    NotCompilable,
    TickParams,
    TickState,
    bind,
    compile_function,
    events_of,
    is_on_disk,
    tick,
)
from graspsense_mujoco_gripper.drive import DriveLaw, set_controls
from graspsense_mujoco_gripper.engine import Contacts, functions
from graspsense_mujoco_gripper.measurement import FARTHEST_M, GapTerms, signs_of

OPTIONS = CompileOptions(install="graspsense-mujoco-gripper[fast]")
WORTH_LOADING, WORTH_COMPILING = 16, 100
"""Grasps of a process from which loading compiled code, and compiling it, takes less time than it saves."""
MOST_TICKS = 2048
"""Ticks that are run at once; between two of these runs a user can interrupt the grasp."""


class Forces(NamedTuple):
    """What the forces on the fingers follow from, see `ForceGauge`."""

    contacts: Contacts
    roles: Any
    axis: Any
    wrench: Any


class SteppedModel(NamedTuple):
    """What stays the same in a grasp: addresses, memory of the model, and settings."""

    model: int
    data: int
    kept: Any
    """The steps of a tick, in parts under the same controls."""
    timestep_s: float
    tick_s: float
    gap: GapTerms
    gap_step_m: float
    forces: Forces
    drive: DriveLaw
    warnings: Any
    most_bytes: int
    """Where the contacts take more memory, MuJoCo may end the process, unless Python calls it."""
    shell: Any
    """The equalities that hold a shell together."""
    equalities: Any
    breaks_at_n: float
    """`inf`: nothing breaks."""
    swing_n: float


class TickBuffers(NamedTuple):
    """The memory of ticks that are run at once."""

    errors: Any
    """(2 most,) The errors of the forces; empty: none."""
    rows: Any
    """(most, 10) The frames."""
    sent: Any
    """(4, most) Kind, value and limits of the commands."""


class Moved(NamedTuple):
    """What the steps of a tick change, besides the memory of the model."""

    gap_m: float
    rate_m_s: float
    target_m: float
    effort_n: float
    broken: bool


class Ticked(NamedTuple):
    """What a tick changes besides: of the measurement, and of the counts for the report."""

    ticks: int
    measured_m: float
    greatest_n: float
    swings: int
    command: Command


def _unbound(*arguments: Any) -> Any:
    raise TypeError("ticks are run by compiled code only: use compiled_ticks")


mj_step: Callable[..., None] = _unbound
contact_force: Callable[..., None] = _unbound
geom_distance: Callable[..., float] = _unbound
control: Callable[[TickParams, TickState, Reading], tuple[Command, TickState]] = _unbound


def ticks_at_once(
    rig: SteppedModel,
    params: TickParams,
    state: TickState,
    moved: Moved,
    ticked: Ticked,
    buffers: TickBuffers,
    most: int,
) -> tuple[int, bool, TickState, Moved, Ticked]:
    """Run up to `most` ticks, until one changes more than the runner leaves to the gripper.

    Return their number, whether MuJoCo has made the steps of one more, and the states then.
    """
    n = 0
    while n < most:
        moved = _move(rig, moved, ticked.command)
        bad = rig.forces.contacts.used_bytes[0] > rig.most_bytes
        for warning in rig.warnings:
            bad = bad or warning != 0
        if bad:
            return n, True, state, moved, ticked
        frame, greatest_n = _measure(rig, moved, ticked, buffers.errors, n)
        command, after = control(params, state, Reading(frame, Pads(0.0, 0, (), ()), ()))
        acts = after.guard.stopped == 1 or (after.guard.acted != 0 and state.guard.acted == 0)
        if after.phase != state.phase or after.done == 1 or after.events != 0 or acts:
            return n, True, state, moved, ticked
        state, swings, previous = after, ticked.swings, ticked.command
        if command.kind == EFFORT and command.value * previous.value < 0.0:
            swings += 1 if min(abs(command.value), abs(previous.value)) > rig.swing_n else 0
        ticked = Ticked(
            ticks=ticked.ticks + 1,
            measured_m=frame.gap_m,
            greatest_n=greatest_n,
            swings=swings,
            command=command,
        )
        _record(buffers.rows, buffers.sent, n, frame, command)
        n += 1
    return n, False, state, moved, ticked


def _move(rig: SteppedModel, moved: Moved, command: Command) -> Moved:
    """Make the steps of a tick, as `MujocoGripper` does."""
    gap_m, rate_m_s, target_m, effort_n, broken = moved
    for steps in rig.kept:
        kept_s = steps * rig.timestep_s
        effort_n, target_m = set_controls(rig.drive, command, gap_m, rate_m_s, kept_s, target_m)
        for _ in range(steps):
            mj_step(rig.model, rig.data)
        before_m, gap_m = gap_m, _gap_m(rig)
        rate_m_s = (gap_m - before_m) / kept_s
        if rig.breaks_at_n < inf and not broken:
            left, right = _forces_n(rig)
            if max(left, right) > rig.breaks_at_n:
                broken = True
                for equality in rig.shell:
                    rig.equalities[equality] = 0
    return Moved(gap_m=gap_m, rate_m_s=rate_m_s, target_m=target_m, effort_n=effort_n, broken=broken)


def _gap_m(rig: SteppedModel) -> float:
    gap = rig.gap
    if len(gap.geoms) > 0:
        return geom_distance(rig.model, rig.data, gap.geoms[0], gap.geoms[1], FARTHEST_M, 0)
    total: float = gap.offset_m
    for k in range(len(gap.places)):
        total += gap.weights[k] * gap.values[gap.places[k]]
    return total


def _forces_n(rig: SteppedModel) -> tuple[float, float]:
    (count, geoms, frames, _), roles, axis, wrench = rig.forces
    left = right = 0.0
    for k in range(count[0]):
        on_left, on_right = signs_of(roles[geoms[k, 0]], roles[geoms[k, 1]])
        if on_left != 0.0 or on_right != 0.0:
            contact_force(rig.model, rig.data, k, wrench.ctypes.data)
            along = 0.0
            for row in range(3):
                start = 3 * row
                component = frames[k, start] * axis[0] + frames[k, start + 1] * axis[1]
                along += (component + frames[k, start + 2] * axis[2]) * wrench[row]
            left += on_left * along
            right += on_right * along
    return left, right


def _measure(rig: SteppedModel, moved: Moved, ticked: Ticked, errors: Any, n: int) -> tuple[Frame, float]:
    """Return the frame of a tick, and the greatest force so far."""
    left, right = _forces_n(rig)
    greatest_n = max(ticked.greatest_n, left, right)
    if len(errors) > 0:
        left, right = left + errors[2 * n], right + errors[2 * n + 1]
    gap_m, step = moved.gap_m, rig.gap_step_m
    if step > 0.0:
        gap_m = round(gap_m / step) * step
    velocity = (gap_m - ticked.measured_m) / rig.tick_s
    t_s = (ticked.ticks + 1) * rig.tick_s
    return Frame(
        t_s=t_s,
        dt_s=rig.tick_s,
        gap_m=gap_m,
        velocity_m_s=velocity,
        effort_n=moved.effort_n,
        force_left_n=left,
        force_right_n=right,
        edge_left_n=nan,
        edge_right_n=nan,
        status=0,
    ), greatest_n


def _record(rows: Any, sent: Any, n: int, frame: Frame, command: Command) -> None:
    rows[n, 0], rows[n, 1], rows[n, 2] = frame.t_s, frame.dt_s, frame.gap_m
    rows[n, 3], rows[n, 4] = frame.velocity_m_s, frame.effort_n
    rows[n, 5], rows[n, 6] = frame.force_left_n, frame.force_right_n
    rows[n, 7], rows[n, 8], rows[n, 9] = frame.edge_left_n, frame.edge_right_n, 0.0
    sent[0, n], sent[1, n] = float(command.kind), command.value
    sent[2, n], sent[3, n] = command.effort_limit_n, command.speed_limit_m_s


def _first_not_below(numbers: Any, number: float) -> int:
    """Return what `bisect_left` does, in compiled code."""
    low, high = 0, len(numbers)
    while low < high:
        middle = (low + high) // 2
        if numbers[middle] < number:
            low = middle + 1
        else:
            high = middle
    return low


def compiled_ticks(step: Callable[..., Any], grasps: int) -> Callable[..., Any] | None:
    """Return `ticks_at_once` for a controller with this step, compiled.

    None where it cannot be compiled, or takes more time than it saves with so many grasps.
    """
    return None if grasps < WORTH_LOADING else _compiled(step, grasps >= WORTH_COMPILING)


@lru_cache(maxsize=16)
def _compiled(step: Callable[..., Any], anew: bool) -> Callable[..., Any] | None:
    """Return `ticks_at_once` compiled; None also where that was not done before, and is not to be done `anew`."""
    try:
        whole = _composed(step)
        return compile_function(whole, OPTIONS) if anew or is_on_disk(whole, OPTIONS) else None
    except (NotCompilable, ImportError, ValueError, RuntimeError):
        return None


def _composed(step: Callable[..., Any]) -> Callable[..., Any]:
    """Return `ticks_at_once` for a controller with this step. Raises ImportError without numba."""
    known = functions()
    forces_n = bind(_forces_n, contact_force=known["mj_contactForce"])
    move = bind(
        _move,
        set_controls=bind(set_controls, bisect_left=_first_not_below),
        mj_step=known["mj_step"],
        _gap_m=bind(_gap_m, geom_distance=known["mj_geomDistance"]),
        _forces_n=forces_n,
    )
    return bind(
        ticks_at_once,
        _move=move,
        _measure=bind(_measure, _forces_n=forces_n),
        control=bind(tick, step=step, events_told=events_of(step)),
    )
