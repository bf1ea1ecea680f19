"""What only the model knows of a finished grasp, and for which quantities it is not as accurate as was asked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense_sim_gripper.run.accuracy.chosen_steps import QUANTITIES, ChosenSteps
from graspsense_sim_gripper.run.nested import TupleType, first_place, with_places
from graspsense_sim_gripper.scene.terms.registry import find_term
from graspsense_sim_gripper.scene.terms.term import TermState
from graspsense_sim_gripper.solve.state import PlantState


def model_report(state: PlantState, kinds: Sequence[str]) -> dict[str, Any]:
    """Return the report of a grasp that ended in this state, of an object with terms of these kinds."""
    contact = state.contact
    beyond = (
        (kind, check(half.states[i]))
        for half in (contact.left, *contact.right)
        for i, kind, check in _checked(tuple(kinds))
    )
    return _report(
        state.peak_n,
        state.step.unresolved + contact.unbalanced,
        any(getattr(term, "broken", 0) == 1 for term in contact.left.states),
        beyond,
    )


def _report(
    peak_n: float, unresolved: float, broken: bool, beyond: Iterable[tuple[str, str]]
) -> dict[str, Any]:
    """Return a report; `beyond` gives the kind of a term and why its law was used beyond its validity, or ''."""
    return {
        "simulated": True,
        "true_peak_force_n": peak_n,
        "resolved": unresolved == 0,
        "broken": broken,
        "beyond": "; ".join(dict.fromkeys(f"{kind}: {reason}" for kind, reason in beyond if reason)),
    }


class _CheckedTerm(NamedTuple):
    """A term whose law may be used beyond its validity, in an array of the numbers of a state."""

    kind: str
    check: Callable[[TermState], str]
    type: TupleType
    """That of its state."""
    begin: int
    """Where the numbers of its state begin."""


class StoredReport(NamedTuple):
    """Makes `model_report` of the numbers of a state, without the named tuples of the state."""

    places: NDArray[np.int64]
    """Where the peak force is among the numbers, the unresolved steps, the unbalanced ones, and what says that a term
    is broken."""
    checked: tuple[_CheckedTerm, ...]

    def report(self, numbers: NDArray[np.float64]) -> dict[str, Any]:
        """Return the report of a grasp that ended in the state of these numbers."""
        peak_n, unresolved, unbalanced, *broken = numbers[self.places].tolist()
        beyond = [
            (kind, check(state.filled(numbers[begin : begin + state.count])))
            for kind, check, state, begin in self.checked
        ]
        return _report(peak_n, unresolved + unbalanced, 1.0 in broken, beyond)


@lru_cache(maxsize=256)
def stored_report(plant: TupleType, terms: tuple[int, ...], kinds: tuple[str, ...]) -> StoredReport:
    """Return what makes the reports of padded states of the plant of this type.

    `terms`: the places of the object's own terms in them; `kinds`: their kinds.
    """
    padded = plant.filled([0.0] * plant.count)
    places_of = with_places(padded)
    states = zip(
        (padded.contact.left, *padded.contact.right),
        (places_of.contact.left, *places_of.contact.right),
        strict=True,
    )
    of_kinds = [(kind, check, terms[i]) for i, kind, check in _checked(kinds)]
    checked = tuple(
        _CheckedTerm(kind, check, TupleType.made_of(half.states[place]), first_place(places.states[place]))
        for half, places in states
        for kind, check, place in of_kinds
    )
    broken = tuple(state.broken for state in places_of.contact.left.states if hasattr(state, "broken"))
    places = places_of.peak_n, places_of.step.unresolved, places_of.contact.unbalanced, *broken
    return StoredReport(np.array(places, np.int64), checked)


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
