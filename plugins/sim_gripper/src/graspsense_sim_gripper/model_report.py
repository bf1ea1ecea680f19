"""What only the model knows of a finished grasp, and for which quantities it is not as accurate as was asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

from graspsense_sim_gripper.dynamics.state import PlantState
from graspsense_sim_gripper.reduction.model import QUANTITIES, Reduction
from graspsense_sim_gripper.terms.registry import find_term
from graspsense_sim_gripper.terms.term import TermState, never_beyond


def model_report(state: PlantState, kinds: Sequence[str]) -> dict[str, Any]:
    """Return the report of a grasp that ended in this state, of an object with terms of these kinds."""
    contact = state.contact
    warnings = {
        f"{kind}: {reason}": None
        for half in (contact.left, *contact.right)
        for i, kind, beyond in _checked(tuple(kinds))
        if (reason := beyond(half.states[i]))
    }
    return {
        "simulated": True,
        "true_peak_force_n": state.peak_n,
        "resolved": state.step.unresolved + state.contact.unbalanced == 0,
        "broken": any(getattr(term, "broken", 0) == 1 for term in contact.left.states),
        "beyond": "; ".join(warnings),
    }


@lru_cache(maxsize=256)
def _checked(kinds: tuple[str, ...]) -> list[tuple[int, str, Callable[[TermState], str]]]:
    """Return place and kind of each term whose law may be used beyond its validity, with what says so."""
    terms = [(i, kind, find_term(kind)[1].beyond) for i, kind in enumerate(kinds, 1)]
    return [term for term in terms if term[2] is not never_beyond]


def accuracy_report(report: Mapping[str, Any], reduction: Reduction, unstable_loop: str) -> dict[str, Any]:
    """Return which quantities are not verified in a grasp with this report and reduced model, and the unstable loop.

    `unstable_loop` is the text of `sampled_loop.instability`.
    """
    valid = reduction.valid_for(report["true_peak_force_n"]) and report["resolved"]
    doubtful = not valid or report["beyond"] != "" or unstable_loop != ""
    return {
        "unstable_loop": unstable_loop,
        "not_verified": list(QUANTITIES if doubtful else reduction.not_verified),
    }
