"""The functions that a function calls, and a fingerprint of their code.

A compiler that keeps machine code on disk has to know when the code of a function, or of anything that it calls, is
another one. `fingerprint` answers that from the byte code, the constants and the values of all globals that are read.
"""

from __future__ import annotations

import dis
import enum
import functools
import hashlib
import sys
import types
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

Replacements = Mapping[Callable[..., Any], Callable[..., Any]]
"""Functions of the interpreter, each with the function that stands for it in compiled code."""

NO_REPLACEMENTS: Final[Replacements] = types.MappingProxyType({})


class NotCompilable(Exception):
    """A function that is outside the subset that can be compiled; the text names it and the reason."""


def fingerprint(
    function: Callable[..., Any],
    replacements: Replacements = NO_REPLACEMENTS,
    known: dict[int, str] | None = None,
) -> str:
    """Return 16 hexadecimal digits that differ where the code, a constant or a called function differs.

    The digits depend on the Python version, on byte code, default values, constants and on the values of the globals
    that the function reads, and likewise on every function that it calls, at any depth. A global whose value cannot be
    described (an object that prints its address) gives another fingerprint in each process.

    `known` keeps the fingerprints of functions by their identity, for several calls between which nothing changes.

    Raises NotCompilable for a closure, for recursion and for anything that is not a function written in Python.
    """
    return _fingerprint(plain_function(function), (), replacements, {} if known is None else known)


def _fingerprint(
    function: types.FunctionType, callers: tuple[int, ...], replacements: Replacements, known: dict[int, str]
) -> str:
    if id(function) not in known:
        digest = hashlib.sha256()
        for item in _description(function, callers, replacements, known):
            digest.update(item.encode())
            digest.update(b"\0")
        known[id(function)] = digest.hexdigest()[:16]
    return known[id(function)]


def plain_function(function: Callable[..., Any]) -> types.FunctionType:
    """Return the Python function of `function`, which may be compiled by numba already.

    Raises NotCompilable for anything that is not a function written in Python.
    """
    plain = _unwrapped(function)
    if not isinstance(plain, types.FunctionType):
        raise NotCompilable(f"{function!r} is not a plain function")
    return plain


def called_functions(
    function: types.FunctionType, replacements: Replacements = NO_REPLACEMENTS
) -> list[tuple[str, types.FunctionType]]:
    """Return the Python functions that are globals of this one, in the order of their names."""
    return [
        (name, plain)
        for name, value in _globals_read(function)
        if isinstance(plain := _replaced(value, replacements), types.FunctionType)
    ]


def copies_if_inlined(
    function: types.FunctionType, replacements: Replacements = NO_REPLACEMENTS
) -> Counter[types.CodeType]:
    """Return how often the code of each function would occur in `function` if every call were inlined.

    Raises NotCompilable for recursion.
    """
    copies: Counter[types.CodeType] = Counter()
    _add_copies(function, 1, (), copies, replacements)
    return copies


@functools.lru_cache(maxsize=4096)
def times_read(code: types.CodeType) -> Counter[str]:
    """Return at how many places the code reads each global name."""
    return Counter(
        str(instruction.argval)
        for each in _with_nested(code)
        for instruction in dis.get_instructions(each)
        if instruction.opname == "LOAD_GLOBAL"
    )


def _add_copies(
    function: types.FunctionType,
    n_copies: int,
    callers: tuple[int, ...],
    copies: Counter[types.CodeType],
    replacements: Replacements,
) -> None:
    _refuse_recursion(function, callers)
    copies[function.__code__] += n_copies
    n_places = times_read(function.__code__)
    for name, called in called_functions(function, replacements):
        _add_copies(called, n_copies * n_places[name], (*callers, id(function)), copies, replacements)


def _description(
    function: types.FunctionType, callers: tuple[int, ...], replacements: Replacements, known: dict[int, str]
) -> Iterator[str]:
    _refuse_recursion(function, callers)
    if function.__closure__:
        raise NotCompilable(
            f"{function.__module__}.{function.__qualname__} is a closure over "
            f"{', '.join(function.__code__.co_freevars)}: pass those as parameters"
        )
    code = function.__code__
    yield f"{sys.version_info[:2]} {function.__module__} {code.co_name}"
    yield f"{function.__defaults__!r} {function.__kwdefaults__!r}"
    for each in _with_nested(code):
        yield from _code_description(each)
    for name, value in _globals_read(function):
        yield name
        called = _replaced(value, replacements)
        if isinstance(called, types.FunctionType):
            yield _fingerprint(called, (*callers, id(function)), replacements, known)
        elif isinstance(value, types.ModuleType):
            yield from _module_description(value, code)
        else:
            yield _value_description(value)
            yield from _generator_description(value)


def _generator_description(value: Any) -> Iterator[str]:
    """Describe the functions of an intrinsic of numba, and those of its module, which generate its code."""
    defined = getattr(value, "_defn", None)
    if not isinstance(defined, types.FunctionType):
        return
    waiting, seen = [defined], {id(defined)}
    while waiting:
        function = waiting.pop()
        for each in _with_nested(function.__code__):
            yield from _code_description(each)
        for name, called in _globals_read(function):
            yield name
            own = isinstance(called, types.FunctionType) and called.__module__ == defined.__module__
            if own and id(called) not in seen:
                seen.add(id(called))
                waiting.append(called)


def _code_description(code: types.CodeType) -> Iterator[str]:
    yield f"{code.co_argcount} {code.co_kwonlyargcount} {code.co_flags} {code.co_varnames} {code.co_names}"
    yield code.co_code.hex()
    yield code.co_exceptiontable.hex()
    yield repr([constant for constant in code.co_consts if not isinstance(constant, types.CodeType)])


def _module_description(module: types.ModuleType, code: types.CodeType) -> Iterator[str]:
    """Describe what the code may read of a module: the compiler takes a module's numbers as constants."""
    yield module.__name__
    for name in sorted({name for each in _with_nested(code) for name in each.co_names}):
        value = getattr(module, name, None)
        if isinstance(value, types.FunctionType) and not value.__closure__:
            yield from _code_description(value.__code__)
        elif value is not None:
            yield _value_description(value)


def _value_description(value: Any) -> str:
    if isinstance(value, enum.EnumType):
        return f"{value.__module__} {value.__qualname__} {list(value)}"
    if isinstance(value, type) and issubclass(value, tuple):
        fields, defaults = getattr(value, "_fields", ()), getattr(value, "_field_defaults", {})
        return f"{value.__module__} {value.__qualname__} {fields} {defaults}"
    if hasattr(value, "tobytes") and hasattr(value, "dtype") and not isinstance(value, type):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    name = getattr(value, "__qualname__", getattr(value, "__name__", None))
    return repr(value) if name is None else f"{getattr(value, '__module__', '')} {name}"


def _globals_read(function: types.FunctionType) -> list[tuple[str, Any]]:
    """Return the globals whose names occur in the code of a function, in the order of their names."""
    names = {name for code in _with_nested(function.__code__) for name in code.co_names}
    return [(name, function.__globals__[name]) for name in sorted(names) if name in function.__globals__]


def _with_nested(code: types.CodeType) -> list[types.CodeType]:
    """Return this code and that of the functions and comprehensions inside it."""
    codes = [code]
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            codes.extend(_with_nested(constant))
    return codes


def _replaced(value: Any, replacements: Replacements) -> Any:
    plain = _unwrapped(value)
    # Only functions are looked up: a global of another type need not be hashable.
    return _unwrapped(replacements.get(plain, plain)) if isinstance(plain, types.FunctionType) else plain


def _unwrapped(value: Any) -> Any:
    """Return the Python function of a function that numba has compiled, anything else as it is."""
    return getattr(value, "py_func", value)


def _refuse_recursion(function: types.FunctionType, callers: tuple[int, ...]) -> None:
    # numba does compile recursion, but not across a cache on disk: the machine code that is loaded calls itself by a
    # name that only the process which compiled it has defined.
    if id(function) in callers:
        raise NotCompilable(
            f"{function.__module__}.{function.__qualname__} calls itself, which cannot be compiled"
        )
