"""A term of an object that gives no finite force: which one it is, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from traceback import walk_tb
from types import CodeType

from graspsense.plugin_api import GraspsenseError
from graspsense_sim_gripper.compiled.compose import plant_move
from graspsense_sim_gripper.dynamics.state import PlantState
from graspsense_sim_gripper.stepping.scheme import PlantParams
from graspsense_sim_gripper.terms.lumped import lumped
from graspsense_sim_gripper.terms.registry import find_term, phases_of
from graspsense_sim_gripper.terms.switchable import Switchable
from graspsense_sim_gripper.terms.term import LAW_ERRORS, Law, TermState


class TermFailed(GraspsenseError):
    """A term of the object gave no finite force, or raised an exception."""


def raised_in_term(error: BaseException, kinds: Sequence[str]) -> str:
    """Return in words which term raised this exception in the interpreter; empty if none of these did."""
    names: dict[CodeType, str] = {find_term(kind)[1].law.__code__: kind for kind in kinds}
    for frame, _ in walk_tb(error.__traceback__):
        if frame.f_code in names:
            at = frame.f_locals.get("d1")
            where = f" at a compression of {at * 1e3:.3g} mm" if isinstance(at, float) else ""
            return f"term {names[frame.f_code]!r} raised {type(error).__name__}: {error}{where}"
    return ""


def not_finite_in_tick(
    kinds: Sequence[str], plant: PlantParams, before: PlantState, effort_n: float, dt_s: float
) -> str:
    """Return in words which term gives no finite force in the tick that begins with `before`."""
    laws = [_checked("lumped", lumped), *(_checked(kind, find_term(kind)[1].law) for kind in kinds)]
    move = plant_move(laws, phases_of(kinds))
    try:
        move(plant, before, effort_n, dt_s)
    except TermFailed as error:
        return str(error)
    except LAW_ERRORS as error:
        return raised_in_term(error, kinds) or str(error)
    return "the simulation gave a force that is not a finite number"


def _checked(kind: str, law: Law) -> Law:
    """Return the switchable law, which raises TermFailed where its force or its state is not finite."""

    def checked(
        term: Switchable, state: TermState, d0: float, d1: float, h: float, v1: float
    ) -> tuple[float, TermState]:
        if term.active == 0:
            return 0.0, state
        force, after = law(term.params, state, d0, d1, h, v1)
        for name, value in (("the force", force), *_numbers(after)):
            if not math.isfinite(value):
                raise TermFailed(
                    f"term {kind!r} gave {name} {value} at a compression of {d1 * 1e3:.3g} mm; a law has to give "
                    "finite numbers at every compression"
                )
        return force, after

    return checked


def _numbers(state: TermState) -> Iterator[tuple[str, float]]:
    """Yield each number of a term's state, with its name."""
    for name in getattr(state, "_fields", ()):
        value = getattr(state, name)
        if isinstance(value, int | float):
            yield f"the state {name} =", value
