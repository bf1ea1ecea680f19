"""Composing a scene's step, and compiling the whole loop where many grasps are wanted.

`sum_of` makes one term of a scene's, `plant_of` binds it into the plant. Everything runs as it is in the
interpreter. `compiled` compiles a bound function with all that it calls, under the options that suit the loop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import TARING, CompileOptions, Inlining, Pads, bind, compile_function, tick
from graspsense_sim_gripper import linear, plant
from graspsense_sim_gripper.linear_modes import Shape
from graspsense_sim_gripper.plant import PlantParams, PlantState
from graspsense_sim_gripper.sensing import SensorParams, SensorState, felt_again, sense
from graspsense_sim_gripper.terms.term import Law


def _nothing(params: Any, states: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    return 0.0, ()


first: Any = _nothing
second: Any = _nothing
third: Any = _nothing
rest: Any = _nothing


def _one(params: Any, states: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    force, state = first(params[0], states[0], d0, d1, h, v1)
    return force, (state,)


def _two(params: Any, states: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    force1, state1 = first(params[0], states[0], d0, d1, h, v1)
    force2, state2 = second(params[1], states[1], d0, d1, h, v1)
    return force1 + force2, (state1, state2)


def _three(params: Any, states: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    force1, state1 = first(params[0], states[0], d0, d1, h, v1)
    force2, state2 = second(params[1], states[1], d0, d1, h, v1)
    force3, state3 = third(params[2], states[2], d0, d1, h, v1)
    return force1 + (force2 + force3), (state1, state2, state3)


def _three_and_more(params: Any, states: Any, d0: float, d1: float, h: float, v1: float) -> tuple[float, Any]:
    force1, state1 = first(params[0], states[0], d0, d1, h, v1)
    force2, state2 = second(params[1], states[1], d0, d1, h, v1)
    force3, state3 = third(params[2], states[2], d0, d1, h, v1)
    more, others = rest(params[3:], states[3:], d0, d1, h, v1)
    return force1 + (force2 + (force3 + more)), (state1, state2, state3, *others)


def sum_of(laws: Sequence[Law]) -> Law:
    """Return one term that is the sum of these: parameters and states become tuples in the same order."""
    if not laws:
        return _nothing
    if len(laws) == 1:
        return bind(_one, first=laws[0])
    if len(laws) == 2:
        return bind(_two, first=laws[0], second=laws[1])
    if len(laws) == 3:
        return bind(_three, first=laws[0], second=laws[1], third=laws[2])
    more = sum_of(laws[3:])
    return bind(_three_and_more, first=laws[0], second=laws[1], third=laws[2], rest=more)


def plant_of(
    laws: Sequence[Law], *, settles: bool = True, **tuples: Any
) -> Callable[[PlantParams, PlantState, float, float], PlantState]:
    """Return `move` for an object that is the sum of these terms; not `settles`: for steps that need not settle.

    `tuples` are what makes the plant's named tuples, where that is not their class (see `maker`).
    """
    squeeze = bind(plant.squeeze, advance=sum_of(laws), **tuples)
    felt = bind(plant._felt, squeeze=squeeze)
    stuck = bind(plant._stuck, _felt=felt, **tuples)
    step = bind(plant._step, _felt=felt, _stuck=stuck, _implicit=bind(plant._implicit, _felt=felt), **tuples)
    glide = bind(plant._glide, **{name: made for name, made in tuples.items() if name == "PlantState"})
    stepped = bind(plant._stepped, _step=step)
    driven = plant._settled if settles else plant._driven
    return bind(plant.move, _driven=bind(driven, _stepped=stepped, _glide=glide))


move: Any = _nothing
control: Any = _nothing


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
"""The rows of the recorded table, one a column of the trace; the phases are whole numbers and stand beside it."""


class Loop(NamedTuple):
    """Where the loop stands between two calls: ticks done and recorded, the images of before the taring."""

    ticks: int
    recorded: int
    phase: int
    untared: int
    effort_n: float


NOT_BEGUN: Final = Loop(0, 0, -1, 0, 0.0)
NOT_NEGATIVE: Final = 0x3FFFFFFF
"""An index with this mask is known not to be negative, which compiled code else asks of each array."""


def grasp(
    plant_params: PlantParams,
    sensor_params: SensorParams,
    dt: float,
    tick_params: Any,
    most_ticks: int,
    loop: Loop,
    body: PlantState,
    sensor: SensorState,
    state: Any,
    left_zero: Any,
    right_zero: Any,
    noise: Any,
    images: Any,
    image_times: Any,
    columns: Any,
    phases: Any,
) -> tuple[Loop, PlantState, SensorState, Any]:
    """Run a grasp to its end, for `most_ticks`, or until there is no more room; return where everything stands.

    The runner's loop on arrays: `left_zero` and `right_zero` (22,) hold the zero before the tare and become the
    tare; `images` (k, 2, 22), the last one NaN at first, and `image_times` (k,) are filled; `columns` (9, n) and
    `phases` (n,) get a number each a tick from the approach on: of the frame without its `dt_s` and status, of which a
    simulated gripper has none, and of what is commanded. Where `images` or `columns` are full it is called again, with
    larger ones that begin alike and with what it returned.
    """
    ticks, recorded, phase, untared, effort = loop
    room = len(columns[0])
    times, gaps, velocities, efforts = columns[0], columns[1], columns[2], columns[3]
    lefts, rights, left_edges, right_edges = columns[4], columns[5], columns[6], columns[7]
    commands = columns[8]
    count = sensor.images
    pads = Pads(sensor.image_t_s, count, images[count - 1][0], images[count - 1][1])
    while ticks < most_ticks and recorded < room and sensor.images < len(images):
        frame, sensor = sense(
            sensor_params, sensor, body, ticks * dt, dt, effort, left_zero, right_zero, noise, images
        )
        if sensor.images != count:
            count = sensor.images
            image_times[count - 1] = sensor.image_t_s
            pads = Pads(sensor.image_t_s, count, images[count - 1][0], images[count - 1][1])
        command, state = control(tick_params, state, frame, pads)
        stepped = phase != TARING
        if state.phase != phase:
            if phase == TARING and count > untared:
                _tare(images, untared, count, left_zero, right_zero)
                sensor = felt_again(sensor, images, left_zero, right_zero)
            phase = state.phase
            untared = count
        effort = command.value
        if phase > TARING and stepped:
            row = recorded & NOT_NEGATIVE
            times[row] = frame.t_s
            gaps[row] = frame.gap_m
            velocities[row] = frame.velocity_m_s
            efforts[row] = frame.effort_n
            lefts[row] = frame.force_left_n
            rights[row] = frame.force_right_n
            left_edges[row] = frame.edge_left_n
            right_edges[row] = frame.edge_right_n
            phases[row] = phase
            commands[row] = effort
            recorded += 1
        ticks += 1
        if state.done == 1 or state.guard.stopped == 1:
            break
        body = move(plant_params, body, effort, dt)
    return Loop(ticks, recorded, phase, untared, effort), body, sensor, state


def _tare(images: Any, begin: int, end: int, left_zero: Any, right_zero: Any) -> None:
    """Make the mean of images `begin` to `end` the zero, summed in the order in which they came."""
    for i in range(len(left_zero)):
        left = images[begin][0][i]
        right = images[begin][1][i]
        for k in range(begin + 1, end):
            left += images[k][0][i]
            right += images[k][1][i]
        left_zero[i] = left / (end - begin)
        right_zero[i] = right / (end - begin)


def grasp_of(
    laws: Sequence[Law],
    step: Callable[..., Any],
    *,
    by_maps: tuple[Sequence[str], Shape] | None = None,
    settles: bool = True,
) -> Callable[..., Any]:
    """Return `grasp` for an object of these terms under this control law, in plain Python.

    `by_maps`: their names and the shape of the maps, where its plant parameters are a `Linear` and exact maps take the
    ticks that they can. Not `settles`: for steps that need not.
    """
    move: Any = plant_of(laws, settles=settles)
    if by_maps is not None:
        move = linear.move_of(*by_maps, move)
    return bind(grasp, move=move, control=bind(tick, step=step))


# ------------------------------------------------------------------------------------------------- compiling


COMPILE_OPTIONS: Final = CompileOptions(
    # Nothing here creates an array, and counting references to the arrays that are passed took half of a tick.
    counts_references=False,
    inlining=Inlining(
        short_code=400,
        long_code=2000,
        before_typing=frozenset(
            function.__code__ for function in (plant.move, plant._driven, plant._settled, plant._stepped)
        ),
        cold_calls=linear.seldom,
    ),
    install="graspsense-sim-gripper[fast]",
)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a loop, or a part of it, compiled with all it calls; see `graspsense.plugin_api.compile_function`.

    Raises NotCompilable for closures and recursion, and where numba cannot be imported.
    """
    return compile_function(function, COMPILE_OPTIONS)
