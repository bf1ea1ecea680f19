"""The loop of a whole grasp on preallocated buffers: in each tick the sensors, the controller and the plant.

It gives the same trace as the runner (`graspsense.core.runner`) with the simulated backend, and can be compiled as a
whole. `test_runner_plain_loop_and_compiled_loop_give_one_trace` verifies that both are equal, including the tare.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import (
    CALLED,
    HOLD,
    SQUEEZE,
    TARING,
    Command,
    Frame,
    Pads,
    Reading,
    TickParams,
    TickState,
    after_free,
    free_from,
    free_tick,
)
from graspsense_sim_gripper.dynamics.state import Contact, Motion, PlantState, is_finite
from graspsense_sim_gripper.sensing import (
    PadBuffers,
    SensorParams,
    SensorState,
    apply_tare,
    moved_sensor,
    next_image_s,
    sense,
    sense_motion,
)
from graspsense_sim_gripper.stepping.coast import glided

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

PlantModel = Any
"""`PlantParams`, or `ExactPlant` where exact discretisation advances the plant."""
Table = Any
"""Rows of numbers: an array in compiled code, a list of lists in the interpreter."""


class GraspParams(NamedTuple):
    """The constants of a grasp."""

    plant: PlantModel
    sensor: SensorParams
    controller: TickParams
    dt_s: float
    max_ticks: int
    palm: Any = ()
    """`PalmParams`; () without an accelerometer."""


class LoopState(NamedTuple):
    """The state of the loop itself between two ticks."""

    ticks: int
    """Number of ticks so far."""
    recorded: int
    """Number of rows recorded so far."""
    phase: int
    """The phase of the last tick; -1 before the first."""
    tare_from: int
    """Number of images when the phase began. The tare is the mean of the images from there on."""
    effort_n: float
    """The commanded effort of the last tick."""
    failed: int
    """1: a force or the motion was not finite after the last tick (see `before_failure`)."""


class FreeProgress(NamedTuple):
    """The part of the state that changes in free motion: between two ticks, after the plant has moved."""

    ticks: int
    recorded: int
    effort_n: float
    """The commanded effort of the last tick."""
    plant: PlantState
    sensor: SensorState
    controller: TickState


class SimulationState(NamedTuple):
    """The complete state of a grasp between two ticks."""

    loop: LoopState
    plant: PlantState
    sensor: SensorState
    controller: TickState
    palm: Any = ()
    """`PalmState`; () without an accelerometer."""


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
    palm: Any = ()
    """`PalmBuffers`; () without an accelerometer."""


EVENT_SHIFT: Final = 8
"""Number of bits of a phase in `Buffers.phases`."""
NOT_STARTED: Final = LoopState(0, 0, -1, 0, 0.0, 0)
NOT_NEGATIVE: Final = 0x3FFFFFFF
"""After `&` with this mask the compiler knows that an index is not negative, and omits the check at each access."""


def _move_unbound(plant: PlantModel, state: PlantState, effort_n: float, dt_s: float) -> PlantState:
    raise TypeError("the loop has no plant: compose.grasp_loop binds one")


def _control_unbound(params: TickParams, state: TickState, reading: Reading) -> tuple[Command, TickState]:
    raise TypeError("the loop has no controller: compose.grasp_loop binds one")


def _no_signals(
    params: Any, state: Any, plant: PlantState, t_s: float, dt_s: float, tick: int, buffers: Any
) -> tuple[Any, Any]:
    return (), state


def _every_tick(
    params: GraspParams, at: FreeProgress, frame: Frame, columns: Table, phases: Any
) -> FreeProgress:
    return at


def _cannot_glide(plant: PlantModel, state: PlantState, dt_s: float) -> bool:
    return False


def _never_glides(
    plant: PlantModel, motion: Motion, contact: Contact, effort_n: float, h: float
) -> tuple[bool, Motion, Contact]:
    return False, motion, contact


def _keep_nothing(signals: Any, buffers: Any, row: int) -> None:
    pass


further_signals: Callable[..., tuple[Any, Any]] = _no_signals
"""What gives `Reading.signals`: `palm.palm_signals` of a gripper with an accelerometer."""
keep_signals: Callable[[Any, Any, int], None] = _keep_nothing
"""What records them: `palm.keep_samples` of a gripper with an accelerometer."""
move: Callable[[PlantModel, PlantState, float, float], PlantState] = _move_unbound
control: Callable[[TickParams, TickState, Reading], tuple[Command, TickState]] = _control_unbound
leap: Callable[[GraspParams, FreeProgress, Frame, Table, Any], FreeProgress] = _every_tick
"""`free_ticks` where several ticks are run at once. In compiled code that gained nothing measurable and took a quarter
longer to compile."""
glide: Callable[[PlantModel, Motion, Contact, float, float], tuple[bool, Motion, Contact]] = _never_glides
"""`stepping.coast.glide`, where it does what `move` does in a tick of free motion."""
can_glide: Callable[[PlantModel, PlantState, float], bool] = _cannot_glide
"""`stepping.coast.can_glide`, likewise."""


def grasp(params: GraspParams, progress: SimulationState, buffers: Buffers) -> SimulationState:
    """Run a grasp to its end, for `max_ticks`, or until a buffer is full or a term fails; return its state then.

    It records frames, commands and phases from the approach on; `dt_s` and the status are constant and left out. If
    `images` or `columns` are full, call it again with the returned state, and with longer buffers that begin with the
    same values.
    """
    dt_s, pad_buffers, columns = params.dt_s, buffers.pads, buffers.columns
    images = pad_buffers.images
    ticks, recorded, phase, tare_from, effort, failed = progress.loop
    plant, sensor, state, palm = progress.plant, progress.sensor, progress.controller, progress.palm
    capacity = len(columns[0])
    count = sensor.images
    pads = Pads(sensor.image_t_s, count, images[count - 1][0], images[count - 1][1])
    while ticks < params.max_ticks and recorded < capacity and sensor.images < len(images):
        frame, sensor = sense(params.sensor, sensor, plant, ticks * dt_s, dt_s, effort, pad_buffers)
        if sensor.images != count:
            count = sensor.images
            buffers.image_times[count - 1] = sensor.image_t_s
            pads = Pads(sensor.image_t_s, count, images[count - 1][0], images[count - 1][1])
        signals, palm = further_signals(params.palm, palm, plant, ticks * dt_s, dt_s, ticks, buffers.palm)
        command, state = control(params.controller, state, Reading(frame, pads, signals))
        past_tare, same_phase = phase != TARING, state.phase == phase
        if not same_phase:
            if phase == TARING and count > tare_from:
                _tare(pad_buffers, tare_from, count)
                sensor = apply_tare(sensor, pad_buffers)
            phase = state.phase
            tare_from = count
        effort = command.value
        if phase > TARING and past_tare:
            row = recorded & NOT_NEGATIVE
            _record(columns, row, frame, effort)
            buffers.phases[row] = phase | state.events << EVENT_SHIFT
            keep_signals(signals, buffers.palm, row)
            recorded += 1
        ticks += 1
        if state.done == 1 or state.guard.stopped == 1:
            break
        # Keeping the plant before the tick as well would cost compiled code a sixth of its time.
        plant = move(params.plant, plant, effort, dt_s)
        if not is_finite(plant):
            failed = 1
            break
        if same_phase and phase != SQUEEZE and phase != HOLD:
            at = FreeProgress(ticks, recorded, effort, plant, sensor, state)
            at = leap(params, at, frame, columns, buffers.phases)
            ticks, recorded, effort, plant, sensor, state = at
    ended = LoopState(ticks, recorded, phase, tare_from, effort, failed)
    return SimulationState(ended, plant, sensor, state, palm)


def free_ticks(
    params: GraspParams, at: FreeProgress, frame: Frame, columns: Table, phases: Any
) -> FreeProgress:
    """Run the ticks of free motion that follow that of `frame`, and return where they end: at `at` if there are none.

    In these ticks no force changes, no cell image is taken or arrives, and the controller follows a law that needs
    neither (see `graspsense.core.free_motion`). What they give is what `grasp` gives tick by tick, to the bit.
    """
    free, now = free_from(params.controller, at.controller, frame)
    if free.kind == CALLED or not _is_free(params, at, frame):
        return at
    dt_s, sensor, image_s = params.dt_s, params.sensor, next_image_s(params.sensor, at.sensor)
    ticks, recorded, effort, plant = at.ticks, at.recorded, at.effort_n, at.plant
    shown = (at.sensor.encoder_ticks, at.sensor.gap_m, at.sensor.velocity_m_s)
    phase, capacity, t_s, n_steps = at.controller.phase, len(columns[0]), 0.0, 0
    motion, contact = plant.motion, plant.contact
    while ticks < params.max_ticks and recorded < capacity:
        next_t_s = ticks * dt_s
        if next_t_s >= image_s:
            break
        next_shown = sense_motion(sensor, shown, motion, dt_s)
        _, gap, velocity = next_shown
        command, next_now = free_tick(params.controller, free, now, next_t_s, dt_s, gap, velocity)
        if command != command:
            break
        glides, next_motion, next_contact = glide(params.plant, motion, contact, command, dt_s)
        if not glides:
            break
        if motion.speed_rev_s != 0.0:
            n_steps += 1
        t_s, shown, now, motion, contact = next_t_s, next_shown, next_now, next_motion, next_contact
        if phase > TARING:
            row = recorded & NOT_NEGATIVE
            columns[0][row], columns[1][row], columns[2][row] = t_s, gap, velocity
            columns[3][row], columns[8][row] = effort, command
            phases[row] = phase
            recorded += 1
        ticks += 1
        effort = command
    if ticks == at.ticks:
        return at
    for row in range(at.recorded, recorded):
        columns[4][row], columns[5][row] = frame.force_left_n, frame.force_right_n
        columns[6][row], columns[7][row] = frame.edge_left_n, frame.edge_right_n
    plant = glided(plant, motion, contact, n_steps)
    state = after_free(params.controller, at.controller, now, effort, t_s)
    return FreeProgress(ticks, recorded, effort, plant, moved_sensor(at.sensor, shown), state)


def _is_free(params: GraspParams, at: FreeProgress, frame: Frame) -> bool:
    """Return whether nothing is pressed, and the next frame shows the forces of this one unless an image arrives."""
    contact = at.plant.contact
    same = frame.force_left_n == contact.left_n and frame.force_right_n == contact.right_n
    return (same or params.sensor.ideal == 0) and can_glide(params.plant, at.plant, params.dt_s)


def before_failure(
    loop: Callable[[GraspParams, SimulationState, Buffers], SimulationState],
    params: GraspParams,
    start: SimulationState,
    buffers: Buffers,
    failed: SimulationState,
) -> PlantState:
    """Return the plant before the tick in which `loop` failed. `start`, `failed`: the states before and after the call.

    The loop runs again up to that tick and writes the same values to the buffers.
    """
    if start.loop.ticks >= failed.loop.ticks - 1:
        return start.plant
    return loop(params._replace(max_ticks=failed.loop.ticks - 1), start, buffers).plant


def has_ended(state: TickState) -> bool:
    """Return whether the controller or the guard has ended the grasp."""
    return bool(state.done == 1 or state.guard.stopped == 1)


def _record(columns: Table, row: int, frame: Frame, command: float) -> None:
    columns[0][row] = frame.t_s
    columns[1][row] = frame.gap_m
    columns[2][row] = frame.velocity_m_s
    columns[3][row] = frame.effort_n
    columns[4][row] = frame.force_left_n
    columns[5][row] = frame.force_right_n
    columns[6][row] = frame.edge_left_n
    columns[7][row] = frame.edge_right_n
    columns[8][row] = command


def _tare(pads: PadBuffers, begin: int, end: int) -> None:
    """Set the zeros to the mean of the images from `begin` to before `end`, added in order of arrival.

    The result is that of `graspsense.core.calibration.tare`, since every simulated cell has a reading.
    """
    for i in range(len(pads.left_zero)):
        left = pads.images[begin][0][i]
        right = pads.images[begin][1][i]
        for k in range(begin + 1, end):
            left += pads.images[k][0][i]
            right += pads.images[k][1][i]
        pads.left_zero[i] = left / (end - begin)
        pads.right_zero[i] = right / (end - begin)
