"""The loop of a whole grasp on preallocated buffers: in each tick the sensors, the controller and the plant.

It gives the same trace as the runner (`graspsense.core.grasp.runner`) with the simulated backend, and can be compiled
as a whole. `test_runner_plain_loop_and_compiled_loop_give_one_trace` verifies that both are equal, including the tare.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import APPROACH, HOLD, SQUEEZE, Command, Frame, Pads, Reading
from graspsense.simulator_api import TARING, TickParams, TickState
from graspsense_sim_gripper.plant.object_model import unbound
from graspsense_sim_gripper.plant.sensing import (
    PadBuffers,
    SensorParams,
    SensorState,
    apply_tare,
    sense,
)
from graspsense_sim_gripper.plant.state import PlantReadings
from graspsense_sim_gripper.solve.macro_step import (
    FIRST_TICKS,
    DenseOutput,
    constant_values,
    held_at_once,
    values_at,
    with_peak,
)
from graspsense_sim_gripper.solve.scheme import PlantParams, PlantState, is_finite
from graspsense_sim_gripper.solve.trend import UNKNOWN, Trend

COLUMNS: Final = (
    "t_s",
    "gap_m",
    "velocity_m_s",
    "effort_n",
    "force_left_n",
    "force_right_n",
    "edge_left_n",
    "edge_right_n",
    "command",
)
"""The rows of the recorded table; each is a column of the trace. The phases are integers, in an array of their own."""

Table = Any
"""Rows of numbers: an array in compiled code, a list of lists in the interpreter."""


class GraspParams(NamedTuple):
    """The constants of a grasp."""

    plant: PlantParams
    sensor: SensorParams
    controller: TickParams
    dt_s: float
    max_ticks: int
    macro_steps: int = 0
    """1: steps of the plant may last several ticks, and the ticks of an approach are run at once
    (`ticks_at_once`)."""


class MacroControl(NamedTuple):
    """The control of steps over several ticks."""

    length: int
    """Number of ticks of the next one."""
    from_tick: int
    """Number of ticks from which on it is tried."""
    wait: int
    """Ticks to wait after one that was not accepted; doubles each time."""
    trend: Trend
    """That at the end of the last one, if it was accepted."""


class Ahead(NamedTuple):
    """A macro-step that has been computed, in whose ticks sensors and controller still have to run."""

    ticks: int
    """Number of its ticks; 0: there is none."""
    values: DenseOutput
    after: PlantState
    control: MacroControl
    """That of the next one, if this one is taken to its end."""


class LastTick(NamedTuple):
    """The last tick."""

    ticks: int
    """Number of ticks so far."""
    recorded: int
    """Number of rows recorded so far."""
    effort_n: float
    """The commanded effort."""


class LastPhase(NamedTuple):
    """The phase of the last tick."""

    phase: int
    """-1 before the first."""
    tare_from: int
    """Number of images when the phase began. The tare is the mean of the images from there on."""


class LoopState(NamedTuple):
    """The state of the loop itself between two ticks."""

    tick: LastTick
    phase: LastPhase
    failed: int
    """1: a force or the motion was not finite after the last tick (see `before_failure`)."""
    macro: MacroControl


class LoopProgress(NamedTuple):
    """The part of the state that changes where several ticks are run at once."""

    tick: LastTick
    plant: PlantState
    sensor: SensorState
    controller: TickState


class SimulationState(NamedTuple):
    """The complete state of a grasp between two ticks."""

    loop: LoopState
    plant: PlantState
    sensor: SensorState
    controller: TickState


class Ending(NamedTuple):
    """What is read of the state in which the loop ends, each time."""

    ticks: int
    recorded: int
    images: int
    """Numbers of ticks, of recorded rows and of cell images so far."""
    failed: int
    """As in `LoopState`."""
    ended: int
    """1: the controller or the guard has ended the grasp."""
    stopped: int
    """As in `GuardState`."""
    outcome: int
    """That of the controller."""


class LoopEnd(NamedTuple):
    """How the loop ended. What takes time to make of compiled code's numbers is made when it is called for."""

    ending: Ending
    state: Callable[[], SimulationState]
    plant: Callable[[], PlantState]


class Buffers(NamedTuple):
    """The memory that the loop writes to: arrays in compiled code, lists in the interpreter."""

    pads: PadBuffers
    """The zeros, which the tare replaces; the noise; and the images, of which the last is NaN at first."""
    image_times: Any
    """(k,) The time at which each image was taken (s)."""
    columns: Table
    """(9, n) The values of `COLUMNS` at each tick from the approach on."""
    phases: Any
    """(n,) The phase of each tick, and above `EVENT_SHIFT` bits the events that the controller told in it."""


EVENT_SHIFT: Final = 8
"""Number of bits of a phase in `Buffers.phases`."""
NOT_STARTED: Final = LoopState(
    LastTick(0, 0, 0.0), LastPhase(-1, 0), 0, MacroControl(FIRST_TICKS, 0, 1, UNKNOWN)
)
ROWS_AT_ONCE: Final = 128
"""The most rows that are recorded at once. The loop stops this many rows before the end of a buffer, so that none is
cut by it."""
NOT_NEGATIVE: Final = 0x3FFFFFFF
"""After `&` with this mask the compiler knows that an index is not negative, and omits the check at each access."""


def no_step(plant: PlantState, control: MacroControl) -> Ahead:
    """Return that no macro-step is taken."""
    return Ahead(0, constant_values(plant), plant, control)


def _never_begins(
    params: GraspParams,
    plant: PlantState,
    sensor: SensorState,
    effort_n: float,
    ticks: int,
    now: MacroControl,
) -> Ahead:
    return no_step(plant, now)


def _every_tick(
    params: GraspParams, progress: LoopProgress, frame: Frame, columns: Table, phases: Any
) -> LoopProgress:
    return progress


move: Callable[[PlantParams, PlantState, float, float], PlantState] = unbound
control: Callable[[TickParams, TickState, Reading], tuple[Command, TickState]] = unbound
begin_macro_step: Callable[..., Ahead] = _never_begins
"""`ticks_at_once.begin_macro_step` where a step may last several ticks."""
run_approach_ticks: Callable[[GraspParams, LoopProgress, Frame, Table, Any], LoopProgress] = _every_tick
"""`ticks_at_once.approach_ticks` where ticks are run at once."""


def grasp(params: GraspParams, progress: SimulationState, buffers: Buffers) -> SimulationState:
    """Run a grasp to its end, for `max_ticks`, or until a buffer is full or a term fails; return its state then.

    It records frames, commands and phases from the approach on; `dt_s` and the status are constant and left out. If
    `images` or `columns` are full, call it again with the returned state, and with longer buffers that begin with the
    same values.
    """
    dt_s, pad_buffers, images = params.dt_s, buffers.pads, buffers.pads.images
    (ticks, recorded, effort), (phase, tare_from), failed, macro = progress.loop
    plant, sensor, state = progress.plant, progress.sensor, progress.controller
    capacity = len(buffers.columns[0]) - ROWS_AT_ONCE
    # The macro-step that is being taken, its number of ticks (0: there is none), and how many of them are over.
    ahead, n, k, peak, count = no_step(plant, macro), 0, 0, plant.peak_n, sensor.cells.images
    pads = Pads(sensor.cells.image_t_s, count, images[count - 1][0], images[count - 1][1])
    while n > 0 or (ticks < params.max_ticks and recorded < capacity and sensor.cells.images < len(images)):
        measured = values_at(ahead.values, k / n) if n > 0 else _readings(plant)
        peak = max(peak, measured.left_n, measured.right_n)
        t_s, last_effort = ticks * dt_s, effort
        frame, sensor = sense(params.sensor, sensor, measured, t_s, dt_s, effort, pad_buffers)
        if sensor.cells.images != count:
            count = sensor.cells.images
            buffers.image_times[count - 1] = sensor.cells.image_t_s
            pads = Pads(sensor.cells.image_t_s, count, images[count - 1][0], images[count - 1][1])
        command, state = control(params.controller, state, Reading(frame, pads, ()))
        past_tare, same_phase = phase != TARING, state.phase == phase
        if not same_phase:
            if phase == TARING and count > tare_from:
                sensor = _tared(sensor, pad_buffers, tare_from, count)
            phase, tare_from = state.phase, count
        effort, ends = command.value, state.done == 1 or state.guard.stopped == 1
        if phase > TARING and past_tare:
            _record(buffers, recorded & NOT_NEGATIVE, frame, effort, state)
            recorded += 1
        ticks += 1
        if n > 0 and (ends or effort != last_effort):
            plant = move(held_at_once(params.plant, plant), plant, last_effort, k * dt_s)
            plant, macro, n = with_peak(plant, peak), MacroControl(FIRST_TICKS, ticks, 1, UNKNOWN), 0
        if ends:
            break
        single = n == 0
        if single and same_phase and effort == last_effort and phase >= APPROACH and ticks >= macro.from_tick:
            ahead, peak = begin_macro_step(params, plant, sensor, effort, ticks, macro), plant.peak_n
            macro, n, k = ahead.control, ahead.ticks, 0
            single = n == 0
        k += 1
        if single:
            plant = move(params.plant, plant, effort, dt_s)
        elif k == n:
            plant, n = with_peak(ahead.after, peak), 0
        if not is_finite(plant):
            failed = 1
            break
        if single and same_phase and phase != SQUEEZE and phase != HOLD:
            advanced = LoopProgress(LastTick(ticks, recorded, effort), plant, sensor, state)
            advanced = run_approach_ticks(params, advanced, frame, buffers.columns, buffers.phases)
            (ticks, recorded, effort), plant, sensor, state = advanced
    ended = LoopState(LastTick(ticks, recorded, effort), LastPhase(phase, tare_from), failed, macro)
    return SimulationState(ended, plant, sensor, state)


def before_failure(
    loop: Callable[[GraspParams, SimulationState, Buffers], SimulationState],
    params: GraspParams,
    start: SimulationState,
    buffers: Buffers,
    failed_at: int,
) -> PlantState:
    """Return the plant before the tick in which `loop` failed, the number of ticks `failed_at`; it began at `start`.

    The loop runs again up to that tick. Steps over several ticks may end elsewhere then, so that the state is near the
    one before.
    """
    if start.loop.tick.ticks >= failed_at - 1:
        return start.plant
    return loop(params._replace(max_ticks=failed_at - 1), start, buffers).plant


def ending(state: SimulationState) -> Ending:
    """Return what is always read of a state in which the loop ended."""
    loop, controller = state.loop, state.controller
    return Ending(
        ticks=loop.tick.ticks,
        recorded=loop.tick.recorded,
        images=state.sensor.cells.images,
        failed=loop.failed,
        ended=1 if has_ended(controller) else 0,
        stopped=controller.guard.stopped,
        outcome=controller.law.outcome,
    )


def has_ended(state: TickState) -> bool:
    """Return whether the controller or the guard has ended the grasp."""
    return bool(state.done == 1 or state.guard.stopped == 1)


def _readings(plant: PlantState) -> PlantReadings:
    """Return what sensors measure of the plant at a tick."""
    return PlantReadings(plant.motion, plant.contact.left_n, plant.contact.right_n)


def _record(buffers: Buffers, row: int, frame: Frame, command: float, state: TickState) -> None:
    """Write the row of a tick."""
    columns = buffers.columns
    buffers.phases[row] = state.phase | state.events << EVENT_SHIFT
    columns[0][row] = frame.t_s
    columns[1][row] = frame.gap_m
    columns[2][row] = frame.velocity_m_s
    columns[3][row] = frame.effort_n
    columns[4][row] = frame.force_left_n
    columns[5][row] = frame.force_right_n
    columns[6][row] = frame.edge_left_n
    columns[7][row] = frame.edge_right_n
    columns[8][row] = command


def _tared(sensor: SensorState, pads: PadBuffers, begin: int, end: int) -> SensorState:
    """Set the zeros to the mean of the images from `begin` to before `end`, added in order of arrival.

    The result is that of `graspsense.core.grasp.calibration.tare`, since every simulated cell has a reading.
    """
    for i in range(len(pads.left_zero)):
        left = pads.images[begin][0][i]
        right = pads.images[begin][1][i]
        for k in range(begin + 1, end):
            left += pads.images[k][0][i]
            right += pads.images[k][1][i]
        pads.left_zero[i] = left / (end - begin)
        pads.right_zero[i] = right / (end - begin)
    return apply_tare(sensor, pads)
