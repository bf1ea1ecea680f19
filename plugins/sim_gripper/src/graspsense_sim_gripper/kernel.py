"""Composing a scene's step, and compiling the whole loop where many grasps are wanted.

`sum_of` makes one term of a scene's, `plant_of` binds it into the plant. Everything runs as it is in the
interpreter. `compiled` compiles a bound function with all it reaches. This is the only module that imports numba,
and only when a loop is compiled.

numba keeps compiled code on disk under a function's file, name and argument types. Two compositions of the same
functions share all three, so each gets a fingerprint of its code, constants and parts in its name: without it a
composition loaded from disk can silently run another's code, and an edited helper is not noticed.
"""

from __future__ import annotations

import dis
import functools
import hashlib
import os
import re
import sys
import types
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import TARING, Pads, bind, cache_folder, tick
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


SHORT_CODE: Final = 400
"""Bytes of byte code up to which a function is taken into all that call it."""
LONG_CODE: Final = 2000
"""Bytes from which on a function stays a call where it would come to stand in several places."""
LEADING: Final = (
    plant.move.__code__,
    plant._driven.__code__,
    plant._settled.__code__,
    plant._stepped.__code__,
)
"""What does little but lead to the next: taken in before types are inferred, since every level of calls has all that
is below it compiled once more."""


class NotCompilable(Exception):
    """A function outside the subset that can be compiled; the text names it and the reason."""


@contextmanager
def first_call(*, by_maps: bool = False) -> Iterator[None]:
    """Have a compiled loop called for the first time in here, which compiles it; `by_maps`: one with exact maps.

    Raises NotCompilable where numba refuses, with the line that it names.
    """
    import numba
    from numba.core.errors import NumbaError, UnsupportedBytecodeError

    config: Any = numba.config
    # Rows side by side are then one instruction; of a loop without products it only makes more instructions.
    given = config.SLP_VECTORIZE
    if by_maps:
        config.SLP_VECTORIZE = 1
    try:
        yield
    except (NumbaError, UnsupportedBytecodeError) as error:
        places = re.findall(r'(?:File "|Raised from )([^"]+?)(?:", line | \()(\d+)', str(error))
        where = ":".join(places[-1]) if places else "a place it does not name"
        reason = next(
            (line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__
        )
        raise NotCompilable(f"the compiler refuses {where}: {reason}") from error
    finally:
        config.SLP_VECTORIZE = given


def compiled(function: Callable[..., Any], memo: dict[Any, Any]) -> Callable[..., Any]:
    """Return `function` compiled with all it reaches; `memo` keeps what this process has compiled.

    Raises NotCompilable for closures and recursion, and where numba cannot be imported.
    """
    try:
        import numba
    except ImportError as error:
        raise NotCompilable('numba is not installed: pip install "graspsense-sim-gripper[fast]"') from error
    if function in memo:
        return memo[function]  # type: ignore[no-any-return]
    copies: Counter[types.CodeType] = Counter()
    _count(_plain(function), 1, (), copies)
    memo[function] = _compiled(function, memo, numba, copies, outermost=True)
    return memo[function]  # type: ignore[no-any-return]


def entry(loop: Callable[..., Any]) -> Callable[..., Any]:
    """Return the machine code of a compiled loop that has run once, for more of the same.

    Called through the loop it would look at the type of each number it is given, which takes twice as long as handing
    them over. What was compiled for several types is returned as it is.
    """
    overloads = list(getattr(loop, "overloads", {}).values())
    return overloads[0].entry_point if len(overloads) == 1 else loop


def _compiled(
    function: Callable[..., Any],
    memo: dict[Any, Any],
    numba: types.ModuleType,
    copies: Counter[types.CodeType],
    outermost: bool,
    places: int = 0,
) -> Callable[..., Any]:
    plain = _plain(function)
    mark = fingerprint(plain)
    key = f"{mark}{'!' if outermost else '?' if places == 0 else ''}"
    if key not in memo:
        counts = _places(plain.__code__)
        seldom = linear.seldom(plain)
        parts = {
            name: _compiled(
                value, memo, numba, copies, outermost=False, places=0 if name in seldom else counts[name]
            )
            for name, value in _functions(plain)
        }
        code = plain.__code__
        # A call that stays one hands all numbers of the tuples over, which takes longer than most functions here. So
        # what stands in one place goes there, and what is short goes everywhere.
        once = places == 1 and (len(code.co_code) < LONG_CODE or copies[code] == 1)
        copy = bind(plain, **parts)
        copy.__qualname__ = f"{plain.__qualname__}_{mark}"
        # Only the outermost is kept on disk, the rest being inside it, and only it is called from the interpreter:
        # a wrapper for that costs more to compile than most functions here.
        memo[key] = numba.njit(
            copy,
            nogil=True,
            cache=outermost and _kept(),
            no_cpython_wrapper=not outermost,
            no_cfunc_wrapper=True,
            forceinline=once or (places > 0 and len(code.co_code) <= SHORT_CODE),
            inline="always" if places == 1 and code in LEADING else "never",
            # Nothing here allocates, and counting references to the arrays that are handed on took half of a tick.
            _nrt=False,
        )
    return memo[key]  # type: ignore[no-any-return]


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a mark that differs where the code, a constant or a part of this function differs, however deep."""
    digest = hashlib.sha256()
    for item in _described(_plain(function), ()):
        digest.update(item.encode())
        digest.update(b"\0")
    return digest.hexdigest()[:16]


def _described(function: types.FunctionType, above: tuple[int, ...]) -> Iterator[str]:
    if id(function) in above:
        raise NotCompilable(f"{function.__module__}.{function.__qualname__} calls itself")
    if function.__closure__:
        raise NotCompilable(
            f"{function.__module__}.{function.__qualname__} is a closure over "
            f"{', '.join(function.__code__.co_freevars)}: pass those as parameters"
        )
    code = function.__code__
    # The interpreter's version and the place of the source: both decide what numba finds on disk.
    yield f"{sys.version_info[:2]} {function.__module__} {code.co_name} {code.co_varnames} {code.co_names}"
    yield code.co_code.hex()
    yield repr([c for c in code.co_consts if not isinstance(c, types.CodeType)])
    yield repr(function.__defaults__)
    for nested in _codes(code)[1:]:
        yield nested.co_code.hex()
        yield repr([c for c in nested.co_consts if not isinstance(c, types.CodeType)])
    for name, value in _reached(function):
        value = _unwrapped(value)
        yield name
        if isinstance(value, types.FunctionType):
            yield from _described(value, (*above, id(function)))
        elif isinstance(value, type) and issubclass(value, tuple):
            fields, defaults = getattr(value, "_fields", ()), getattr(value, "_field_defaults", {})
            yield f"{value.__module__} {value.__qualname__} {fields} {defaults}"
        elif isinstance(value, int | float | str | bool | tuple):
            yield repr(value)
        else:
            yield getattr(value, "__qualname__", getattr(value, "__name__", type(value).__qualname__))


def _count(
    function: types.FunctionType, copies: int, above: tuple[int, ...], found: Counter[types.CodeType]
) -> None:
    """Count in how many places the code of each function would stand if all were taken in."""
    if id(function) in above:
        raise NotCompilable(
            f"{function.__module__}.{function.__qualname__} calls itself, which cannot be compiled"
        )
    found[function.__code__] += copies
    counts = _places(function.__code__)
    for name, value in _functions(function):
        _count(_plain(value), copies * counts[name], (*above, id(function)), found)


def _functions(function: types.FunctionType) -> list[tuple[str, Any]]:
    """Return the functions that this one calls, by name."""
    return [
        (name, value)
        for name, value in _reached(function)
        if isinstance(_unwrapped(value), types.FunctionType)
    ]


@functools.cache
def _places(code: types.CodeType) -> Counter[str]:
    """Return in how many places the code reads each global name."""
    return Counter(
        str(one.argval)
        for each in _codes(code)
        for one in dis.get_instructions(each)
        if one.opname == "LOAD_GLOBAL"
    )


def _reached(function: types.FunctionType) -> list[tuple[str, Any]]:
    names: dict[str, None] = {}
    for code in _codes(function.__code__):
        names.update(dict.fromkeys(code.co_names))
    return [(n, function.__globals__[n]) for n in sorted(names) if n in function.__globals__]


def _codes(code: types.CodeType) -> list[types.CodeType]:
    found = [code]
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            found.extend(_codes(constant))
    return found


def _unwrapped(value: Any) -> Any:
    """Return the plain function of one that is already compiled by numba, anything else as it is."""
    return getattr(value, "py_func", value)


def _plain(function: Callable[..., Any]) -> types.FunctionType:
    plain = _unwrapped(function)
    if not isinstance(plain, types.FunctionType):
        raise NotCompilable(f"{function!r} is no plain function")
    return plain


@functools.cache
def _kept() -> bool:
    """Have compiled code kept in a folder of the user's, as an installed package may not be writable.

    Return whether it is: where there is no such folder each process compiles anew.
    """
    import numba

    if "NUMBA_CACHE_DIR" in os.environ:
        return True
    folder = cache_folder()
    if folder is None:
        return False
    folder /= "compiled"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    setattr(numba.config, "CACHE_DIR", str(folder))  # noqa: B010  numba fills its config at run time
    return os.access(folder, os.W_OK | os.X_OK)
