"""The known terms: those of this package, and those that plugins provide by the hook `graspsense_sim_terms`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import cache
from typing import Final

from graspsense.plugin_api import UnknownName
from graspsense.simulator_api import bind, collect, suggestion
from graspsense_sim_gripper.scene.terms import (
    elastic,
    foam,
    fracture,
    gas,
    liquid,
    loss,
    maxwell,
    rigid,
    slosh,
    snap,
    surface,
    worn,
)
from graspsense_sim_gripper.scene.terms.term import Law, Moves, OnSum, Phase, Term, switched, switched_on_sum

TERMS: Final[dict[str, Term]] = {
    module.TERM.name: module.TERM
    for module in (elastic, rigid, maxwell, gas, loss, foam, snap, worn, surface, liquid, slosh, fracture)
}
"""The terms of this package, in the order that every object uses, so that equal terms are compiled once."""

HOOK: Final = "graspsense_sim_terms"


@cache
def _foreign() -> dict[str, Term]:
    """Return the terms of plugins by qualified name, sorted."""
    by_name: dict[str, Term] = {}
    for distribution, terms in collect(HOOK):
        try:
            given = list(terms)
        except TypeError:
            given = [terms]
        for term in given:
            if not isinstance(term, Term):
                warnings.warn(f"{HOOK} of {distribution} gave {term!r}, which is not a Term", stacklevel=2)
            elif f"{distribution}/{term.name}" in by_name:
                warnings.warn(f"{HOOK} of {distribution} gave two terms {term.name!r}", stacklevel=2)
            else:
                by_name[f"{distribution}/{term.name}"] = term
    return dict(sorted(by_name.items()))


def find_term(name: str) -> tuple[str, Term]:
    """Return the unique name of a term, and the term.

    The unique name of a plugin's term is `distribution/name`; its short name is accepted if no other plugin uses it.
    Raises UnknownName.
    """
    if name in TERMS:
        return name, TERMS[name]
    foreign = _foreign()
    if name in foreign:
        return name, foreign[name]
    matching = [term for term in foreign if term.rpartition("/")[2] == name]
    if len(matching) == 1:
        return matching[0], foreign[matching[0]]
    if matching:
        raise UnknownName(f"several distributions have a term {name!r}: write one of {', '.join(matching)}")
    known = [*TERMS, *foreign]
    raise UnknownName(f"no term {name!r}. Known: {', '.join(known)}.{suggestion(name, known)}")


def in_order(names: Sequence[str]) -> list[int]:
    """Return the indices that sort these names: the terms of this package in their order, then those of plugins.

    The term that acts on the sum of the others is the last. Raises UnknownName.
    """
    ours = list(TERMS)

    def place(i: int) -> tuple[bool, bool, int, str]:
        name = names[i]
        known = name in TERMS
        return find_term(name)[1].on_sum is not None, not known, ours.index(name) if known else 0, name

    return sorted(range(len(names)), key=place)


def laws_of(names: Sequence[str]) -> list[Law | OnSum]:
    """Return the laws of an object with these terms. The parameters of each are `Switchable`. Raises UnknownName."""
    return switchable(active_laws(names))


def switchable(laws: Sequence[Law | OnSum]) -> list[Law | OnSum]:
    """Return these laws with parameters that are `Switchable`."""
    return [
        OnSum(bind(switched_on_sum, on_sum=law.law)) if isinstance(law, OnSum) else bind(switched, law=law)
        for law in laws
    ]


def active_laws(names: Sequence[str]) -> list[Law | OnSum]:
    """Return the laws that `laws_of` makes switchable."""
    terms = [find_term(name)[1] for name in names]
    return [term.law if term.on_sum is None else OnSum(term.on_sum) for term in terms]


def phases_of(names: Sequence[str]) -> list[tuple[int, Phase]]:
    """Return the terms with events among those of `laws_of`: the place of each, and its `phase`. Raises UnknownName."""
    terms = [find_term(name)[1] for name in names]
    return [(i, term.phase) for i, term in enumerate(terms) if term.phase]


def moving_of(names: Sequence[str]) -> list[tuple[int, Moves]]:
    """Return the terms that move in a free object, among those of `laws_of`: the place of each, and its `moves`.

    Raises UnknownName.
    """
    terms = [find_term(name)[1] for name in names]
    return [(i, term.moves) for i, term in enumerate(terms) if term.moves]
