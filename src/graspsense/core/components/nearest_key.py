"""The key that a misspelt one most probably means, anywhere among the keys that there are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import SequenceMatcher
from typing import Any, Final

from graspsense.core.values.errors import suggestion

LEAST_LIKENESS: Final = 0.7
"""Limit on the similarity of two keys, below which none is proposed from another table."""
_LONGEST_KEY: Final = 100


def key_paths(declarations: Mapping[str, Mapping[str, Any]], table: str) -> Iterator[str]:
    """Yield the dotted path of each key that `keys_of` declares, also in its tables: `gripper.faults.drop`."""
    for key, declaration in declarations.items():
        path = f"{table}.{key}" if table else key
        yield path
        yield from key_paths(declaration.get("keys", {}), path)


def nearest_path(wrong: str, known: Iterable[str]) -> str:
    """Return the known dotted path that `wrong` most probably means, the first of equals; empty if none is similar.

    >>> nearest_path("probing_force_n", ["gripper.type", "controller.probing_force_n"])
    'controller.probing_force_n'
    """
    if len(wrong) > _LONGEST_KEY:
        return ""
    name = wrong.rpartition(".")[2]

    def likeness(path: str) -> float:
        last = path.rpartition(".")[2]
        whole = SequenceMatcher(None, wrong, path).ratio()
        if last == name:
            return 1.0 + whole * ("." in wrong)
        return SequenceMatcher(None, name, last).ratio() + 0.01 * whole

    known = list(known)
    best = max(known, key=likeness, default="")
    return best if best and likeness(best) >= LEAST_LIKENESS else ""


def did_you_mean(path: str, siblings: Sequence[str], elsewhere: Iterable[str]) -> str:
    """Return `" Did you mean 'x'?"` for an unknown key: a key of its own table, or the whole path of another.

    `siblings` are the keys of the table that `path` is in; `elsewhere` are the paths of all keys.
    """
    name = path.rpartition(".")[2]
    near = nearest_path(path, elsewhere)
    if near and (near.rpartition(".")[2] == name or not suggestion(name, siblings)):
        return f" Did you mean {near!r}?"
    return suggestion(name, siblings) or suggestion(path.partition(".")[0], siblings)
