"""A term of an object that gives no finite force: which one it is, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from graspsense.gripper_api import GraspsenseError
from graspsense_sim_gripper.run.compiled.compose import plant_move
from graspsense_sim_gripper.scene.terms.registry import active_laws, phases_of
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS, Law, OnSum, SumLaw, Switchable, TermState
from graspsense_sim_gripper.solve.scheme import PlantParams, PlantState


class TermFailed(GraspsenseError):
    """A term of the object gave no finite force, or raised an exception."""


def not_finite_in_tick(
    kinds: Sequence[str], plant: PlantParams, state: PlantState, effort_n: float, dt_s: float
) -> str:
    """Return in words which term raises, or gives no finite force, in the tick that begins with `state`."""
    laws = [
        OnSum(_checked_on_sum(kind, law.law)) if isinstance(law, OnSum) else _checked(kind, law)
        for kind, law in zip(kinds, active_laws(kinds), strict=True)
    ]
    move = plant_move(laws, phases_of(kinds))
    try:
        move(plant, state, effort_n, dt_s)
    except (TermFailed, *LAW_ERRORS) as error:
        return str(error)
    return "the simulation gave a force that is not a finite number"


def _checked(kind: str, law: Law) -> Law:
    """Return the switchable law, which raises TermFailed where it raises, or its force or its state is not finite."""

    def checked(
        term: Switchable, state: TermState, d0: float, d1: float, h: float, v1: float
    ) -> tuple[float, TermState]:
        if term.active == 0:
            return 0.0, state
        return _finite(kind, lambda: law(term.params, state, d0, d1, h, v1), d1)

    return checked


def _checked_on_sum(kind: str, law: SumLaw) -> SumLaw:
    """Return the switchable law of a term that acts on the sum, which raises TermFailed as that of `_checked` does."""

    def checked(term: Switchable, state: TermState, force_n: float, d1: float) -> tuple[float, TermState]:
        if term.active == 0:
            return force_n, state
        return _finite(kind, lambda: law(term.params, state, force_n, d1), d1)

    return checked


def _finite(kind: str, call: Callable[[], tuple[float, TermState]], d1: float) -> tuple[float, TermState]:
    """Return force and state. Raises TermFailed if the law raises, or one of their numbers is not finite."""
    where = f"at a compression of {d1 * 1e3:.3g} mm"
    try:
        force, state = call()
    except LAW_ERRORS as error:
        raise TermFailed(f"term {kind!r} raised {type(error).__name__}: {error} {where}") from error
    for name, value in (("the force", force), *_numbers(state)):
        if not math.isfinite(value):
            raise TermFailed(
                f"term {kind!r} gave {name} {value} {where}; a law has to give finite numbers at every compression"
            )
    return force, state


def _numbers(state: TermState) -> Iterator[tuple[str, float]]:
    """Yield each number of a term's state, with its name."""
    for name in getattr(state, "_fields", ()):
        value = getattr(state, name)
        if isinstance(value, int | float):
            yield f"the state {name} =", value
