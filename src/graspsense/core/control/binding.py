"""Composition of pure functions: a generic function names its parts as module globals, and `bind` supplies them.

A bound function runs in the interpreter and can be compiled as a whole, so that each law is written once.
"""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType, MethodType
from typing import Any, TypeVar, cast

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])
TupleT = TypeVar("TupleT", bound=tuple[Any, ...])


def bind(function: FunctionT, **parts: Any) -> FunctionT:
    """Return a copy of `function` in which `parts` replace the globals of its module with those names.

    Raises TypeError for anything but a plain function, and for a part whose name is not a global of the module.
    """
    if not isinstance(function, FunctionType):
        raise TypeError(f"{function!r} is not a plain function, so it cannot be bound")
    unknown = parts.keys() - function.__globals__.keys()
    if unknown:
        raise TypeError(f"{function.__module__}.{function.__name__} has no part named {sorted(unknown)}")
    # The interpreter caches lookups of globals in the code object, so copies that share one would evict each other.
    code = function.__code__.replace()
    bound = FunctionType(code, {**function.__globals__, **parts}, function.__name__, function.__defaults__)
    bound.__module__, bound.__qualname__ = function.__module__, function.__qualname__
    return cast(FunctionT, bound)


def maker(named_tuple: type[TupleT]) -> Callable[..., TupleT]:
    """Return a function that builds `named_tuple` from its fields, in a third to half of the time of calling the class.

    Bind it in place of the class where a function runs many times in the interpreter.
    """
    return MethodType(named_tuple.__new__, named_tuple)
