"""Which terms there are: ours, and those that other distributions bring through `graspsense_sim_terms`."""

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
from graspsense_sim_gripper.terms.remainder import remainder, where_kept
from graspsense_sim_gripper.terms.term import Law, Term

TERMS: Final[dict[str, Term]] = {
    module.TERM.name: module.TERM
    for module in (elastic, rigid, maxwell, gas, loss, foam, snap, worn, surface, liquid, slosh)
}
"""Our terms by name. Scenes list theirs in this order, whatever order a file has: one composition, one compile."""

HOOK: Final = "graspsense_sim_terms"


@cache
def _foreign() -> dict[str, Term]:
    """Return other distributions' terms by qualified name, in its order."""
    found: dict[str, Term] = {}
    for distribution, terms in collect(HOOK):
        try:
            given = list(terms)
        except TypeError:
            given = [terms]
        for one in given:
            if not isinstance(one, Term):
                warnings.warn(f"{HOOK} of {distribution} gave {one!r}, which is no Term", stacklevel=2)
            elif f"{distribution}/{one.name}" in found:
                warnings.warn(f"{HOOK} of {distribution} gave two terms {one.name!r}", stacklevel=2)
            else:
                found[f"{distribution}/{one.name}"] = one
    return dict(sorted(found.items()))


def find_term(name: str) -> tuple[str, Term]:
    """Return the term of this name, with the name that is its only one.

    Ours have short names. Others' are `distribution/name`; the short name does where nobody else has it. Raises
    UnknownName.
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
        raise UnknownName(f"term {name!r} is of several distributions: write one of {', '.join(matching)}")
    known = [*TERMS, *foreign]
    raise UnknownName(f"no term {name!r}. Known: {', '.join(known)}.{suggestion(name, known)}")


def in_order(names: Sequence[str]) -> list[int]:
    """Return the places of these names in the canonical order: ours as above, then others' by name."""
    ours = list(TERMS)
    return sorted(
        range(len(names)),
        key=lambda i: (0, ours.index(names[i]), "") if names[i] in TERMS else (1, 0, names[i]),
    )


def laws_of(names: Sequence[str]) -> list[Law]:
    """Return the laws of an object of these terms, as its parts are kept: what limits leave over, then each term's.

    Their parameters are `Kept`. Raises UnknownName.
    """
    return [bind(where_kept, law=one) for one in (remainder, *(find_term(name)[1].law for name in names))]
