"""Checks of the terms that a plugin contributes; `graspsense plugins check` runs them.

The checks use only the attributes `name`, `params`, `law` and `at_rest`; a term need not be a `Term`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice, pairwise
from math import isfinite
from typing import TYPE_CHECKING, Any, Final

from graspsense.simulator_api import NotCompilable, fingerprint

if TYPE_CHECKING:
    from graspsense_sim_gripper.scene.terms.term import TermParams

SPEED_M_S: Final = 0.1
COMPRESSION_M: Final = 2e-3
"""The compression up to which a law is evaluated in turn, and back, at this speed."""
STEPS: Final = (20, 2000)
"""The numbers of steps up and back. Only the last are short enough for the work of a term that oscillates."""
CREATED: Final = 0.01
"""Share of the work that the steps may seem to create."""
FALLBACK: Final = 0.05
"""The value of a parameter without a default."""


def check_terms(results: Sequence[Any]) -> Iterator[str]:
    """Yield a text for each defect of the terms that a plugin contributes.

    A law must depend on its arguments only, change nothing else, give a finite force, keep the types of its state, and
    give back no more work than it took. `results` holds what each implementation of `graspsense_sim_terms` returned: a
    term, or several.
    """
    for result in results:
        for term in [result] if hasattr(result, "law") else result:
            params = term.params(
                **{name: term.params._field_defaults.get(name, FALLBACK) for name in term.params._fields}
            )
            yield from islice(filter(None, (_law_defect(term, params, steps) for steps in STEPS)), 1)


def _law_defect(term: Any, params: TermParams, steps: int) -> str:
    """Return the first defect of the law of a term; empty if there is none."""
    state, called = term.at_rest, f"the law of term {term.name!r}"
    unchanged, work_j, most_j, force_before = _known_as(term.law), 0.0, 0.0, 0.0
    tick_s = COMPRESSION_M / steps / SPEED_M_S
    way_m = (COMPRESSION_M / steps * (steps - abs(steps - k)) for k in range(2 * steps + 1))
    for d0, d1 in pairwise((0.0, *way_m)):
        try:
            force, after = term.law(params, state, d0, d1, tick_s, (d1 - d0) / tick_s)
            again = term.law(params, state, d0, d1, tick_s, (d1 - d0) / tick_s)
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
        if d0 == d1 == 0.0 and force:
            return f"{called} gives {force:.3g} N at rest without compression, with {params}: 0 N"
        state = after
        work_j += 0.5 * (force_before + force) * (d1 - d0)
        most_j, force_before = max(most_j, work_j), force
        if steps == STEPS[-1] and work_j < -CREATED * most_j:
            return (
                f"{called} has given back {-work_j:.2g} J more than the {most_j:.2g} J that went into it, at "
                f"{d1 * 1e3:.2g} mm with {params}: a passive object bears less force while it is released, and none "
                "without compression"
            )
    if _known_as(term.law) != unchanged:
        return f"{called} changes a global: keep in its state what it is to remember"
    return ""


def _known_as(law: Any) -> str:
    """Return a text that differs where the code of a law or a global in it does; empty for what cannot be compiled."""
    with suppress(NotCompilable):
        return fingerprint(law)
    return ""
