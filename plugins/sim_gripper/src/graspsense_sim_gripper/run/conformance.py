"""Checks of the terms that a plugin contributes; `graspsense plugins check` runs them.

The checks use only the attributes `name`, `params`, `law` and `at_rest`; a term need not be a `Term`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isfinite
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from graspsense_sim_gripper.scene.terms.term import TermParams

STEPS: Final = 40
TICK_S: Final = 1e-3
COMPRESSIONS_M: Final = tuple(0.0001 * (20 - abs(20 - k)) for k in range(STEPS + 1))
"""The compressions (m) at which a law is evaluated in turn: up to 2 mm in steps of 0.1 mm, and back."""
FALLBACK: Final = 0.05
"""The value of a parameter without a default."""


def check_terms(results: Sequence[Any]) -> Iterator[str]:
    """Yield a text for each defect of the terms that a plugin contributes.

    A law must depend on its arguments only, give a finite force, and keep the types of its state. `results` holds what
    each implementation of `graspsense_sim_terms` returned: a term, or several.
    """
    for result in results:
        for term in [result] if hasattr(result, "law") else result:
            params = term.params(
                **{name: term.params._field_defaults.get(name, FALLBACK) for name in term.params._fields}
            )
            defect = _law_defect(term, params)
            if defect:
                yield defect


def _law_defect(term: Any, params: TermParams) -> str:
    """Return the first defect of the law of a term; empty if there is none."""
    state, called = term.at_rest, f"the law of term {term.name!r}"
    for d0, d1 in pairwise(COMPRESSIONS_M):
        try:
            force, after = term.law(params, state, d0, d1, TICK_S, (d1 - d0) / TICK_S)
            again = term.law(params, state, d0, d1, TICK_S, (d1 - d0) / TICK_S)
        except Exception as error:
            return (
                f"{called} raised {type(error).__name__}: {error} from {d0 * 1e3:.2g} to {d1 * 1e3:.2g} mm "
                f"with {params}"
            )
        if not (type(force) is float and isfinite(force)):
            return (
                f"{called} gives the force {force!r} ({type(force).__name__}) at a compression of {d1 * 1e3:.2g} mm "
                f"with {params}: a finite float"
            )
        if repr(again) != repr((force, after)):
            return f"{called} gives another force for the same arguments: the force must depend on the arguments only"
        if type(after) is not type(state) or [type(x) for x in after] != [type(x) for x in state]:
            return (
                f"{called} turns {state!r} into {after!r}: keep the named tuple and the types of its numbers"
            )
        state = after
    return ""
