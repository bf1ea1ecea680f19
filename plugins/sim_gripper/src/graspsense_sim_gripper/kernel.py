"""Composing a scene's step, and compiling the whole loop where many grasps are wanted.

`sum_of` makes one term of a scene's, `plant_of` binds it into the plant. Everything runs as it is in the
interpreter. `compiled` compiles a bound function with all that it calls, under the options that suit the loop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

from graspsense.plugin_api import CompileOptions, Inlining, bind, compile_function, tick
from graspsense_sim_gripper import plant
from graspsense_sim_gripper.dynamics.state import PlantState
from graspsense_sim_gripper.exact.modes import Shape
from graspsense_sim_gripper.exact.propagate import bind_move, cold_calls
from graspsense_sim_gripper.loop import grasp
from graspsense_sim_gripper.plant import PlantParams
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
    glide = bind(plant._glide, **tuples)
    stepped = bind(plant._stepped, _step=step)
    driven = plant._settled if settles else plant._driven
    return bind(plant.move, _driven=bind(driven, _stepped=stepped, _glide=glide))


def grasp_of(
    laws: Sequence[Law],
    step: Callable[..., Any],
    *,
    by_maps: tuple[Sequence[str], Shape] | None = None,
    settles: bool = True,
) -> Callable[..., Any]:
    """Return `grasp` for an object of these terms under this control law, in plain Python.

    `by_maps`: their names and the shape of their modes, where the plant parameters are an `ExactPlant` and exact
    discretisation advances the ticks that it can. Not `settles`: for steps that need not.
    """
    move: Any = plant_of(laws, settles=settles)
    if by_maps is not None:
        move = bind_move(*by_maps, move)
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
        cold_calls=cold_calls,
    ),
    install="graspsense-sim-gripper[fast]",
)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a loop, or a part of it, compiled with all it calls; see `graspsense.plugin_api.compile_function`.

    Raises NotCompilable for closures and recursion, and where numba cannot be imported.
    """
    return compile_function(function, COMPILE_OPTIONS)
