"""Composing the functions of a scene: the sum of its terms, the motion of the plant, and the loop of a grasp.

A generic function reads its parts, such as the law of a term, as globals. `binding.bind_reachable` makes a copy of the
function, and of the functions that it calls, in which these globals are the given parts. The result runs in the
interpreter as it is, and `compiled.jit` compiles it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import Frame
from graspsense.simulator_api import bind, events_of, free_parts, maker, tick
from graspsense_sim_gripper.plant.balance import BalanceSearch, PadLoad, solve_contact
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.sensing import CellReading, EncoderReading, SensorState
from graspsense_sim_gripper.plant.state import Contact, ContactState, Motion, Past
from graspsense_sim_gripper.run.binding import Constructors, bind_reachable
from graspsense_sim_gripper.run.loop import SimulationState, grasp
from graspsense_sim_gripper.run.problem import ControllerStep
from graspsense_sim_gripper.run.ticks_at_once import approach_ticks, begin_macro_step
from graspsense_sim_gripper.scene.terms.registry import active_laws, find_term, laws_of, moving_of, phases_of
from graspsense_sim_gripper.scene.terms.term import (
    LAW_ERRORS,
    Law,
    Moves,
    OnSum,
    Phase,
    SumLaw,
    Switchable,
    TermState,
    switched_on_sum,
)
from graspsense_sim_gripper.solve.advance import advance, move
from graspsense_sim_gripper.solve.converge import refine_until_converged
from graspsense_sim_gripper.solve.scheme import Attempt, PlantParams, PlantState, Start, StepState

TermsStates = Any
"""A tuple with a state of its own type for each term."""
TermsParams = Any
"""A tuple with parameters of its own type for each term."""
PlantMove = Callable[[Any, PlantState, float, float], PlantState]
"""`move(model, state, effort_n, dt_s) -> state` over one tick."""
ContactSolver = Callable[[ObjectModel, ContactState, float, float, float], tuple[ContactState, int]]
"""`plant.balance.solve_contact` with the terms of an object."""

INTERPRETED: Final[Constructors] = {
    kind: maker(kind)
    for kind in (
        *(PlantState, Motion, Contact, ContactState, Past, StepState, Start, Attempt, PadLoad, BalanceSearch),
        *(SensorState, EncoderReading, CellReading, Frame),
    )
}
"""The named tuples that a tick creates, each with a constructor that takes the interpreter half the time."""


# ------------------------------------------------------------------------------------------ the object's terms


def _no_terms(
    params: TermsParams, states: TermsStates, d0: float, d1: float, h: float, v1: float
) -> tuple[float, TermsStates]:
    return 0.0, ()


head: Law = _no_terms
tail: Law = _no_terms


def _sum_of_two(
    params: TermsParams, states: TermsStates, d0: float, d1: float, h: float, v1: float
) -> tuple[float, TermsStates]:
    force, state = head(params[0], states[0], d0, d1, h, v1)
    total, others = tail(params[1:], states[1:], d0, d1, h, v1)
    return force + total, (state, *others)


summands: Law = _no_terms
on_sum: SumLaw = switched_on_sum


def _acted_on(
    params: TermsParams, states: TermsStates, d0: float, d1: float, h: float, v1: float
) -> tuple[float, TermsStates]:
    total, summed = summands(params[:-1], states[:-1], d0, d1, h, v1)
    force, state = on_sum(params[-1], states[-1], total, d1)
    return force, (*summed, state)


def sum_of(laws: Sequence[Law | OnSum]) -> Law:
    """Return one law that is the sum of these; its parameters and states are tuples in the same order.

    Forces are added from the last to the first. A term without force then changes no bit of the sum, and a padded
    object has exactly the force of the original one. The last law may act on the sum of the others.
    """
    *others, last = laws or [OnSum(switched_on_sum)]
    if isinstance(last, OnSum):
        return bind(_acted_on, summands=_summed(others), on_sum=last.law) if laws else _no_terms
    return _summed(laws)


def _summed(laws: Sequence[Any]) -> Law:
    total: Law = _no_terms
    for law in reversed(laws):
        total = bind(_sum_of_two, head=law, tail=total)
    return total


def sum_of_active(laws: Sequence[Law | OnSum]) -> Law:
    """Return what `sum_of` computes with `laws_of`, bit for bit, in a form that suits the interpreter.

    It takes the `active_laws`, calls those of the active terms only, and cannot be compiled. The force is NaN where a
    law raises an exception.
    """
    from_last = tuple([(i, law) for i, law in reversed(list(enumerate(laws))) if not isinstance(law, OnSum)])

    # The active terms of the last parameters, which a grasp does not change: one tuple, so that threads may share it.
    active_of: tuple[TermsParams, Sequence[tuple[int, Law, Any]]] = ((), ())

    def force_of_active(
        params: TermsParams, states: TermsStates, d0: float, d1: float, h: float, v1: float
    ) -> tuple[float, TermsStates]:
        nonlocal active_of
        known, active = active_of
        if known is not params:
            active = [(i, law, params[i].params) for i, law in from_last if params[i].active == 1]
            active_of = params, active
        total, after = 0.0, list(states)
        for i, law, term in active:
            try:
                force, after[i] = law(term, after[i], d0, d1, h, v1)
            except LAW_ERRORS:
                force = math.nan
            total = force + total
        return total, tuple(after)

    last = laws[-1] if laws else None
    if not isinstance(last, OnSum):
        return force_of_active
    on_sum = last.law

    def acted_on(
        params: TermsParams, states: TermsStates, d0: float, d1: float, h: float, v1: float
    ) -> tuple[float, TermsStates]:
        total, after = force_of_active(params, states, d0, d1, h, v1)
        active, term = params[-1]
        if active == 0:
            return total, after
        try:
            force, state = on_sum(term, after[-1], total, d1)
        except LAW_ERRORS:
            return math.nan, after
        return force, (*after[:-1], state)

    return acted_on


def _no_phase(states: TermsStates) -> int:
    return 0


def _no_move(states: TermsStates) -> bool:
    return False


N_PHASES: Final = 8
PLACE: int = 0
term: Callable[[TermState], Any] = _no_phase
others: Callable[[TermsStates], Any] = _no_phase


def _phase_and_others(states: TermsStates) -> Any:
    return term(states[PLACE]) + N_PHASES * others(states)


def _one_moves(states: TermsStates) -> Any:
    return term(states[PLACE]) or others(states)


def _of_all(fold: Any, nothing: Any, terms: Sequence[tuple[int, Any]]) -> Any:
    """Return a function of the states of all terms; `terms`: the place of each among them, and its own function."""
    combined = nothing
    for place, own in reversed(terms):
        combined = bind(fold, PLACE=place, term=own, others=combined)
    return combined


def all_active(terms: Sequence[Any]) -> tuple[Switchable, ...]:
    """Return the parameters of these terms as the sum of `laws_of` takes them: all active."""
    return tuple([Switchable(1, params) for params in terms])


def uncompressed(kinds: Sequence[str]) -> ContactState:
    """Return the state of an object of these terms that nothing has pressed yet."""
    states = tuple([find_term(kind)[1].at_rest for kind in kinds])
    return ContactState(
        compression_m=0.0, force_n=0.0, slope_n_m=0.0, states=states, pad_m=0.0, branch_n=0.0, past=Past()
    )


# ------------------------------------------------------------------------------------------ plant and loop


class Composition(NamedTuple):
    """What the code of a loop depends on, besides the controller. Loops are cached and compiled by it."""

    kinds: tuple[str, ...]
    """The kinds of the object's terms."""
    converges: bool
    """Whether the steps of a tick are halved until the result no longer changes."""
    lags: bool = False
    """Whether the force of the drive lags behind the command."""
    held: bool = False
    """Whether the object is held fast, so that its state has two halves."""


def composition(kinds: tuple[str, ...], plant: PlantParams) -> Composition:
    """Return the composition of a loop for this plant."""
    converges, lags = plant.steps.settle > 0.0, plant.drive.lag_s > 0.0
    held = plant.object.held == 1
    return Composition(kinds=kinds, converges=converges, lags=lags, held=held)


@lru_cache(maxsize=64)
def contact_solver(kinds: tuple[str, ...]) -> ContactSolver:
    """Return `solve_contact` for an object of these terms."""
    return bind_reachable(solve_contact, {"object_force": sum_of_active(active_laws(kinds))}, INTERPRETED)


def plant_move(
    laws: Sequence[Law | OnSum],
    phases: Sequence[tuple[int, Phase]] = (),
    moving: Sequence[tuple[int, Moves]] = (),
    *,
    converges: bool = True,
    lags: bool = True,
) -> Callable[[PlantParams, PlantState, float, float], PlantState]:
    """Return `move` for an object whose force is the sum of these laws, with the events of `phases_of`.

    `moving`: the terms that move in a free object, as `moving_of` returns them.

    `converges`: whether the steps of a tick may be halved until the result no longer changes; `lags`: whether the force
    of the drive may lag behind the command.
    """
    over_a_tick: PlantMove = refine_until_converged if converges else advance
    if lags:
        over_a_tick = bind(move, advance=over_a_tick)
    return bind_reachable(over_a_tick, _object_parts(laws, phases, moving))


def _object_parts(
    laws: Sequence[Law | OnSum], phases: Sequence[tuple[int, Phase]], moving: Sequence[tuple[int, Moves]]
) -> dict[str, Any]:
    """Return what the contact of the object calls: its force, a number for the phases of its terms, its motion."""
    return {
        "object_force": sum_of(laws),
        "object_phase": _of_all(_phase_and_others, _no_phase, phases),
        "object_moves": _of_all(_one_moves, _no_move, moving),
    }


@lru_cache(maxsize=64)
def composed_move(composition: Composition, *, interpreted: bool = True) -> PlantMove:
    """Return the function that advances the plant by a tick; `interpreted` False: in the form that is compiled."""
    kinds = composition.kinds
    move = plant_move(
        laws_of(kinds),
        phases_of(kinds),
        moving_of(kinds),
        converges=composition.converges,
        lags=composition.lags,
    )
    if not interpreted:
        return move
    return bind_reachable(move, {"object_force": sum_of_active(active_laws(kinds))}, INTERPRETED)


def step_parts(composition: Composition) -> dict[str, Any]:
    """Return what the steps of this plant call."""
    kinds = composition.kinds
    return _object_parts(laws_of(kinds), phases_of(kinds), moving_of(kinds))


def _may_last_several_ticks(composition: Composition) -> bool:
    """Return whether a step of this plant may last several ticks."""
    return not (composition.converges or composition.lags)


@lru_cache(maxsize=64)
def grasp_loop(
    composition: Composition, step: ControllerStep, *, interpreted: bool = True
) -> Callable[..., SimulationState]:
    """Return the loop of a grasp for a controller with this step; `interpreted` False: in the form that is compiled."""
    control = bind_reachable(tick, {"step": step, "events_told": events_of(step)})
    parts: dict[str, Any] = {"move": composed_move(composition, interpreted=False), "control": control}
    if _may_last_several_ticks(composition):
        parts["begin_macro_step"] = bind_reachable(begin_macro_step, step_parts(composition))
        if law := free_parts(step):
            constructors = INTERPRETED if interpreted else None
            parts["run_approach_ticks"] = bind_reachable(approach_ticks, law, constructors)
    loop = bind_reachable(grasp, parts)
    if not interpreted:
        return loop
    force = sum_of_active(active_laws(composition.kinds))
    return bind_reachable(loop, {"object_force": force}, INTERPRETED)
