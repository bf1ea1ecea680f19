"""Binding the generic parts of a function at any depth.

A generic function names its parts as globals. `bind` of `graspsense.plugin_api` fills them in one function;
`bind_reachable` fills them in wherever they are read by the function or by the functions that it calls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import FunctionType
from typing import Any, TypeVar

from graspsense.simulator_api import bind

Part = Any
"""A function, constant or class that a generic function reads as a global."""
Constructors = Mapping[Any, Part]
"""Classes of named tuples, each with the function that creates them."""
FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def bind_reachable(
    function: FunctionT, parts: Mapping[str, Part], constructors: Constructors | None = None
) -> FunctionT:
    """Return a copy of `function` in which it, and every function that it calls, sees these parts as its globals.

    A part replaces the global of its name wherever that is read. A class among the keys of `constructors` is replaced
    by its value wherever that is read, whatever its name. Functions that reach neither stay as they are, and so do the
    parts themselves. Raises TypeError for a part that nothing reads.
    """
    unread = set(parts)
    bound: FunctionT = _bound(function, parts, constructors or {}, unread, {})
    if unread:
        raise TypeError(f"nothing that {function.__qualname__} calls names a part {sorted(unread)}")
    return bound


def _bound(
    function: Part,
    parts: Mapping[str, Part],
    constructors: Constructors,
    unread: set[str],
    done: dict[int, Part],
) -> Part:
    if id(function) in done:
        return done[id(function)]
    replaced = {}
    for name in function.__code__.co_names:
        if name not in function.__globals__:
            continue
        value = function.__globals__[name]
        if name in parts:
            replaced[name] = parts[name]
            unread.discard(name)
        elif isinstance(value, FunctionType):
            called = _bound(value, parts, constructors, unread, done)
            if called is not value:
                replaced[name] = called
        elif isinstance(value, type) and value in constructors:
            replaced[name] = constructors[value]
    done[id(function)] = bind(function, **replaced) if replaced else function
    return done[id(function)]
