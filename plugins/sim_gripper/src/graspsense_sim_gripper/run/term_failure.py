"""A term of an object that gives no finite force: which one it is, in words."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from graspsense.gripper_api import GraspsenseError
from graspsense_sim_gripper.run.compiled.compose import plant_move
from graspsense_sim_gripper.scene.terms.registry import active_laws, phases_of, switchable
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS, OnSum, TermParams, TermState
from graspsense_sim_gripper.solve.scheme import PlantParams, PlantState


class TermFailed(GraspsenseError):
    """A term of the object gave no finite force, or raised an exception."""


def not_finite_in_tick(
    kinds: Sequence[str], plant: PlantParams, state: PlantState, effort_n: float, dt_s: float
) -> str:
    """Return in words which term raises, or gives no finite force, in the tick that begins with `state`."""
    checked = [
        OnSum(_checked(kind, law.law)) if isinstance(law, OnSum) else _checked(kind, law)
        for kind, law in zip(kinds, active_laws(kinds), strict=True)
    ]
    move = plant_move(switchable(checked), phases_of(kinds))
    try:
        move(plant, state, effort_n, dt_s)
    except (TermFailed, *LAW_ERRORS) as error:
        return str(error)
    return "the simulation gave a force that is not a finite number"


def _checked(kind: str, law: Callable[..., tuple[float, TermState]]) -> Any:
    """Return a law, or that of a term that acts on the sum, which checks its results.

    It raises TermFailed where the law raises, or its force or a number of its state is not finite.
    """

    def checked(params: TermParams, state: TermState, *given: float) -> tuple[float, TermState]:
        # The second of these is the compression, of both forms of laws.
        where = f"at a compression of {given[1] * 1e3:.3g} mm"
        try:
            force, after = law(params, state, *given)
        except LAW_ERRORS as error:
            raise TermFailed(f"term {kind!r} raised {type(error).__name__}: {error} {where}") from error
        for name, value in (("the force", force), *_numbers(after)):
            if not math.isfinite(value):
                raise TermFailed(
                    f"term {kind!r} gave {name} {value} {where}; a law has to give finite numbers at every compression"
                )
        return force, after

    return checked


def _numbers(state: TermState) -> Iterator[tuple[str, float]]:
    """Yield each number of a term's state, with its name."""
    for name in getattr(state, "_fields", ()):
        value = getattr(state, name)
        if isinstance(value, int | float):
            yield f"the state {name} =", value
