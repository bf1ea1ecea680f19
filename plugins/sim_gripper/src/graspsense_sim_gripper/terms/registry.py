"""The known terms: those of this package, and those that plugins provide by the hook `graspsense_sim_terms`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import cache
from typing import Final

from graspsense.plugin_api import UnknownName, bind, collect, suggestion
from graspsense_sim_gripper.terms import (
    elastic,
    foam,
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
from graspsense_sim_gripper.terms.lumped import lumped
from graspsense_sim_gripper.terms.switchable import switched
from graspsense_sim_gripper.terms.term import Law, Phase, Term, one_phase

TERMS: Final[dict[str, Term]] = {
    module.TERM.name: module.TERM
    for module in (elastic, rigid, maxwell, gas, loss, foam, snap, worn, surface, liquid, slosh)
}
"""The terms of this package, in the order that every object uses, so that equal terms are compiled once."""

HOOK: Final = "graspsense_sim_terms"


@cache
def _foreign() -> dict[str, Term]:
    """Return the terms of plugins by qualified name, sorted."""
    found: dict[str, Term] = {}
    for distribution, terms in collect(HOOK):
        try:
            given = list(terms)
        except TypeError:
            given = [terms]
        for one in given:
            if not isinstance(one, Term):
                warnings.warn(f"{HOOK} of {distribution} gave {one!r}, which is not a Term", stacklevel=2)
            elif f"{distribution}/{one.name}" in found:
                warnings.warn(f"{HOOK} of {distribution} gave two terms {one.name!r}", stacklevel=2)
            else:
                found[f"{distribution}/{one.name}"] = one
    return dict(sorted(found.items()))


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
    matching = [one for one in foreign if one.rpartition("/")[2] == name]
    if len(matching) == 1:
        return matching[0], foreign[matching[0]]
    if matching:
        raise UnknownName(f"several distributions have a term {name!r}: write one of {', '.join(matching)}")
    known = [*TERMS, *foreign]
    raise UnknownName(f"no term {name!r}. Known: {', '.join(known)}.{suggestion(name, known)}")


def in_order(names: Sequence[str]) -> list[int]:
    """Return the indices that sort these names: the terms of this package in their order, then those of plugins."""
    ours = list(TERMS)
    return sorted(
        range(len(names)),
        key=lambda i: (0, ours.index(names[i]), "") if names[i] in TERMS else (1, 0, names[i]),
    )


def laws_of(names: Sequence[str]) -> list[Law]:
    """Return the laws of an object with these terms: that of the lumped spring and damper, then that of each term.

    The parameters of each are `Switchable`. Raises UnknownName.
    """
    return [bind(switched, law=one) for one in (lumped, *(find_term(name)[1].law for name in names))]


def phases_of(names: Sequence[str]) -> list[tuple[int, Phase]]:
    """Return the terms with events among those of `laws_of`: the place of each, and its `phase`. Raises UnknownName."""
    terms = [find_term(name)[1] for name in names]
    return [(i, term.phase) for i, term in enumerate(terms, 1) if term.phase is not one_phase]
