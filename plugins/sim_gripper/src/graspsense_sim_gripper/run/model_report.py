"""What only the model knows of a finished grasp, and for which quantities it is not as accurate as was asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

from graspsense_sim_gripper.run.accuracy.chosen_steps import QUANTITIES, ChosenSteps
from graspsense_sim_gripper.run.nested import Stored, TupleType, taken, with_places
from graspsense_sim_gripper.scene.terms.registry import find_term
from graspsense_sim_gripper.scene.terms.term import TermState
from graspsense_sim_gripper.solve.scheme import PlantState


class _Told(NamedTuple):
    """What the report tells of the state in which a grasp ended, or where it is among the numbers of the state."""

    peak_n: float
    unresolved: float
    unbalanced: float
    left: tuple[TermState, ...]
    """The states of the object's own terms."""
    right: tuple[TermState, ...]
    """Those of its half at the right finger, if it has one."""


def model_report(state: PlantState, kinds: Sequence[str]) -> dict[str, Any]:
    """Return the report of a grasp that ended in this state, of an object with terms of these kinds."""
    return _report(_told(state, range(len(kinds))), tuple(kinds))


def stored_report(end: Stored, terms: tuple[int, ...], kinds: tuple[str, ...]) -> dict[str, Any]:
    """Return the same of a stored state of a padded object, without the named tuples of the state.

    `terms`: the places of the object's own terms in it; `kinds`: their kinds.
    """
    return _report(taken(_places_told(end.type, terms), end.numbers.tolist()), kinds)


@lru_cache(maxsize=256)
def _places_told(plant: TupleType, terms: tuple[int, ...]) -> Any:
    return _told(with_places(plant.pattern), terms)


def _told(state: PlantState, terms: Sequence[int]) -> _Told:
    contact = state.contact
    own = [tuple([half.states[i] for i in terms]) for half in (contact.left, *contact.right)]
    return _Told(
        peak_n=state.peak_n,
        unresolved=state.step.unresolved,
        unbalanced=contact.unbalanced,
        left=own[0],
        right=own[1] if len(own) > 1 else (),
    )


def _report(told: _Told, kinds: tuple[str, ...]) -> dict[str, Any]:
    beyond = (
        (kind, check(states[i]))
        for states in (told.left, told.right)
        if states
        for i, kind, check in _checked(kinds)
    )
    return {
        "simulated": True,
        "true_peak_force_n": told.peak_n,
        "resolved": told.unresolved + told.unbalanced == 0,
        "broken": any(getattr(term, "broken", 0) == 1 for term in told.left),
        "beyond": "; ".join(dict.fromkeys(f"{kind}: {reason}" for kind, reason in beyond if reason)),
    }


@lru_cache(maxsize=256)
def _checked(kinds: tuple[str, ...]) -> list[tuple[int, str, Callable[[TermState], str]]]:
    """Return place and kind of each term whose law may be used beyond its validity, with what says so."""
    terms = [(i, kind, find_term(kind)[1].beyond) for i, kind in enumerate(kinds)]
    return [(i, kind, beyond) for i, kind, beyond in terms if beyond]


class GraspModel(NamedTuple):
    """The model of an object in which a grasp was simulated, as far as its report needs it."""

    kinds: tuple[str, ...]
    """Those of the object's own terms."""
    chosen: ChosenSteps | None
    """Its steps; None without an object."""
    unstable_loop: str
    """The text of `sampled_loop.instability` for the scene."""


NO_MODEL: Final = GraspModel((), None, "")


def accuracy_report(report: Mapping[str, Any], chosen: ChosenSteps, unstable_loop: str) -> dict[str, Any]:
    """Return which quantities are not verified in a grasp with this report and these steps, and the unstable loop.

    `unstable_loop` is as in `GraspModel`.
    """
    valid = chosen.valid_for(report["true_peak_force_n"]) and report["resolved"]
    doubtful = not valid or report["beyond"] != "" or unstable_loop != ""
    return {
        "unstable_loop": unstable_loop,
        "not_verified": list(QUANTITIES if doubtful else chosen.not_verified),
    }
