"""The functions of the builder, compiled (needs numba and graspsense: the extra ``fast``)."""

from __future__ import annotations

from functools import cache
from typing import Any

from graspsense.simulator_api import CompileOptions, compile_function, first_call, is_on_disk
from graspsense_c45 import arithmetic
from graspsense_c45.arrays import Integers, IntegerTable
from graspsense_c45.building import dealing, descent, growing
from graspsense_c45.building.dealing import Entries, Place, Split
from graspsense_c45.building.nodes import Nodes


def _enter_no_values(
    a: int, place: Place, total: int, entries: Entries, search: growing.SplitSearch, rules: growing.Rules
) -> None:
    pass


def _deal_no_missing(
    place: Place, known_stop: int, split: Split, counts: IntegerTable, entries: Entries, deal: dealing.Deal
) -> bool:
    return True


def _count_all(a: int, place: Place, counts: Integers, entries: Entries, known: Integers) -> int:
    return place.stop


def _weigh_nothing(node: int, nodes: Nodes, rows: descent.Rows, path: descent.Descent) -> None:
    pass


_ALWAYS: dict[Any, Any] = {arithmetic.term: arithmetic.new_term}
_WHERE_SLIM: dict[Any, Any] = {
    growing.enter_values: _enter_no_values,
    dealing.deal_missing: _deal_no_missing,
    growing.count_known: _count_all,
    descent.weigh_known: _weigh_nothing,
}
"""What is not called where all attributes are numeric and no value is missing; a quarter of compiling is for that."""


def _options(slim: bool) -> CompileOptions:
    return CompileOptions(
        # No function makes an array or a list: for those numba compiles a library, which takes longer than all these.
        counts_references=False,
        # That nothing is divided by zero need not be checked: the rules take care of it.
        error_model="numpy",
        replacements=_ALWAYS | _WHERE_SLIM if slim else _ALWAYS,
        install="graspsense-c45[fast]",
    )


@cache
def _compiled(function: Any, slim: bool) -> Any:
    return compile_function(function, _options(slim))


def call(function: Any, slim: bool, *arguments: Any) -> Any:
    """Call a function of the builder, compiled; slim: all attributes are numeric, and no value is missing."""
    with first_call():
        return _compiled(function, slim)(*arguments)


def kept(slim: bool) -> bool:
    """Return whether the machine code that grows such a tree is on disk."""
    return is_on_disk(growing.grow, _options(slim))
