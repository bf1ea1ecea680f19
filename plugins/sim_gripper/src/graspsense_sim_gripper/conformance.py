"""Checks of the terms that a plugin contributes; `graspsense plugins check` runs them.

The checks use only the attributes `name`, `params`, `law`, `at_rest` and `linear`; a term need not be a `Term`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isfinite
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from graspsense_sim_gripper.terms.term import TermParams, TermState

STEPS: Final = 40
TICK_S: Final = 1e-3
COMPRESSIONS_M: Final = tuple(0.0001 * (20 - abs(20 - k)) for k in range(STEPS + 1))
"""The compressions (m) at which a law is evaluated in turn: up to 2 mm in steps of 0.1 mm, and back."""
FALLBACK: Final = 0.05
"""The value of a parameter without a default."""


def check_terms(results: Sequence[Any]) -> Iterator[str]:
    """Yield a text for each defect of the terms that a plugin contributes.

    A law must depend on its arguments only, give a finite force, keep the types of its state, and agree with its linear
    form. `results` holds what each implementation of `graspsense_sim_terms` returned: a term, or several.
    """
    for result in results:
        for term in [result] if hasattr(result, "law") else result:
            params = term.params(
                **{name: term.params._field_defaults.get(name, FALLBACK) for name in term.params._fields}
            )
            defect = _law_defect(term, params) or _linear_defect(term, params)
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


def _linear_defect(term: Any, params: TermParams) -> str:
    """Return the first difference between the linear form and the law of a term; empty if there is none.

    Both are evaluated over short intervals at a constant rate of compression.
    """
    form = term.linear(params) if hasattr(term, "linear") else None
    if form is None:
        return ""
    own_contact = hasattr(form, "reach")
    forms = (form.touching, form.parted) if own_contact else (form,)
    fields = len(term.at_rest)
    for part in forms:
        if len(part.rates) not in (0, fields):
            return (
                f"the linear form of term {term.name!r} has {len(part.rates)} states and its law {fields}: give as "
                "many, or none"
            )
    fastest = max((sum(map(abs, row)) for part in forms for row in part.rates), default=0.0)
    h, speed, state = min(TICK_S, 0.1 / max(fastest, 1e-9)), 0.1, term.at_rest
    for k in range(STEPS):
        d0, d1 = (speed * h * step for step in (k, k + 1))
        force, after = term.law(params, state, d0, d1, h, speed)
        before, end = (
            forms[own_contact and not d + sum(a * b for a, b in zip(form.reach, s, strict=True)) > 0.0]
            if own_contact
            else form
            for d, s in ((d0, state), (d1, after))
        )
        linear = _force_after(before, state if before.rates else (), d0, speed, h)
        scale = max(abs(force), abs(before.spring_n_m) * speed * h, 1e-9)
        if before is end and not abs(linear - force) <= 1e-3 * scale:
            return (
                f"the linear form of term {term.name!r} gives {linear:.6g} N at {d1 * 1e3:.3g} mm and its law "
                f"{force:.6g} N with {params}: return None where it is not linear"
            )
        state = after
    return ""


def _force_after(form: Any, state: TermState, d0: float, speed: float, h: float) -> float:
    """Return the force (N) of a linear form after `h` seconds at `speed`, by the midpoint rule in 50 steps."""
    pieces = 50
    step, now, d = h / pieces, [float(x) for x in state], d0

    def rates(s: list[float], d: float) -> list[float]:
        return [
            sum(a * b for a, b in zip(row, s, strict=True)) + by * d + at * speed
            for row, by, at in zip(form.rates, form.by_compression, form.by_speed, strict=True)
        ]

    for _ in range(pieces):
        half = [s + 0.5 * step * r for s, r in zip(now, rates(now, d), strict=True)]
        now = [s + step * r for s, r in zip(now, rates(half, d + 0.5 * step * speed), strict=True)]
        d += step * speed
    own = sum(a * b for a, b in zip(form.force, now, strict=True)) if now else 0.0
    return float(form.spring_n_m * d + form.damper_n_s_m * speed + own)
