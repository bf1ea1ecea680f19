"""Compiling a function with all it calls, and keeping the machine code on disk.

`compile_function` compiles a plain function, often one whose parts are filled in by `bind`, together with the Python
functions that are its globals. numba does the work and is imported when a function is compiled. Three traps of numba's
cache on disk are avoided here:

- numba names machine code after file, function and argument types. Two compositions of the same functions share all
  three, and one would silently run the other's code. The fingerprint of the code is therefore part of the name.
- numba loads machine code from disk while the file of the outermost function is unchanged, although a function that it
  calls was edited in another file; and not if that file lies elsewhere, although nothing was edited. The fingerprint
  covers everything that is called, and nothing else decides.
- Options of the compiler are not part of numba's key. They are part of the name as well.

A function that is called has to be a global of its caller; a function of another module (`module.function`) is imported
by name for this.
"""

from __future__ import annotations

import hashlib
import re
import types
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from functools import cache, partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final, Literal

from attrs import field, frozen

from graspsense.core.compiling.call_graph import (
    NO_REPLACEMENTS,
    NotCompilable,
    Replacements,
    called_functions,
    copies_if_inlined,
    fingerprint,
    plain_function,
    times_read,
)
from graspsense.core.compiling.compile_notice import compiling_begins
from graspsense.core.compiling.compiled_code_folder import compiled_code_folder
from graspsense.core.control.binding import bind
from graspsense.core.control.garbage_collection import no_collection

MAX_COMPILED: Final = 4096
"""Compiled functions that a process holds; at that number all are given up and compiled (or loaded) again."""


def _no_cold_calls(function: types.FunctionType) -> tuple[str, ...]:
    return ()


@frozen
class Inlining:
    """Which calls are inlined. These are hints: they change times, not results."""

    short_code: int
    """Bytes of byte code up to which a function is inlined wherever it is called."""
    long_code: int
    """Bytes of byte code from which on a function is not inlined if its code would occur more than once."""
    before_typing: frozenset[types.CodeType] = frozenset()
    """Code that is inlined before types are inferred: functions that do little more than call another one.

    Every level of calls has the code below it compiled once more, so this shortens compiling."""
    cold_calls: Callable[[types.FunctionType], Collection[str]] = _no_cold_calls
    """Returns the names that a function seldom calls; these remain calls."""


@frozen
class CompileOptions:
    """How functions are compiled."""

    counts_references: bool = True
    """Whether arrays are reference counted. False is faster, and only for code that creates no array or list."""
    uncounted: frozenset[types.CodeType] = frozenset()
    """Code of called functions that create no array or list: they do not count references in any case."""
    error_model: Literal["python", "numpy"] = "python"
    """Division by zero raises ZeroDivisionError ("python") or gives infinity or NaN ("numpy")."""
    inlining: Inlining | None = None
    """Which calls are inlined; by default the compiler decides."""
    replacements: Replacements = NO_REPLACEMENTS
    """Python functions, each with the function that is compiled in its place."""
    releases_lock: bool = True
    """Whether other threads may run Python code meanwhile. False is faster for a function of a few microseconds."""
    install: str = "numba"
    """The requirement that brings numba, named to a user who does not have it."""


_COMPILED: dict[str, Callable[..., Any]] = {}
"""What this process has compiled, by fingerprint, options and role, so that an entry is never out of date."""


def compile_function(
    function: Callable[..., Any], options: CompileOptions | None = None
) -> Callable[..., Any]:
    """Return `function` compiled with all the Python functions that it calls.

    The machine code is made at the first call with arguments of each type, or loaded from disk; see `first_call`. It is
    kept in the user's cache folder, or in NUMBA_CACHE_DIR where that is set; a folder that another user can write to is
    not used. The compiled function runs without the interpreter's lock, unless the options say otherwise.

    Raises NotCompilable for closures, for recursion (which numba's cache cannot hold), for anything that is not a
    function written in Python, and where numba cannot be imported or is switched off (NUMBA_DISABLE_JIT).
    """
    options = options or CompileOptions()
    try:
        import numba
    except ImportError as error:
        raise NotCompilable(f'numba is not installed: pip install "{options.install}"') from error
    if getattr(numba.config, "DISABLE_JIT", 0):  # numba sets it from the environment
        raise NotCompilable("NUMBA_DISABLE_JIT is set")
    if len(_COMPILED) >= MAX_COMPILED:
        _COMPILED.clear()
    return _Compilation(numba, options).outermost(plain_function(function))


def is_on_disk(function: Callable[..., Any], options: CompileOptions | None = None) -> bool:
    """Return whether an earlier process has kept the machine code of `compile_function(function, options)` on disk.

    That is answered without numba. The code may be for arguments of other types. Raises NotCompilable as
    `compile_function` does for the function.
    """
    plain = plain_function(function)
    folder = _folder_of(plain)
    if folder is None:
        return False
    try:
        digest = _Compilation(None, options or CompileOptions()).digest(plain)
    except PackageNotFoundError:
        return False
    # The index of a function is named after its qualified name, which ends with the digest.
    return any(folder.glob(f"*_{digest}.nbi"))


@contextmanager
def first_call() -> Iterator[None]:
    """Call a compiled function for the first time inside this context, which compiles it.

    Raises NotCompilable if numba refuses, with the file and line that it names.
    """
    from numba.core.errors import NumbaError, UnsupportedBytecodeError

    try:
        # The compiler makes millions of objects, nearly all of which remain until it has ended.
        with no_collection():
            yield
    except (NumbaError, UnsupportedBytecodeError) as error:
        places = re.findall(r'(?:File "|Raised from )([^"]+?)(?:", line | \()(\d+)', str(error))
        where = ":".join(places[-1]) if places else "a place it does not name"
        reason = next(
            (line.strip() for line in str(error).splitlines() if line.strip()), type(error).__name__
        )
        raise NotCompilable(f"the compiler refuses {where}: {reason}") from error


def entry_point(compiled: Callable[..., Any]) -> Callable[..., Any]:
    """Return the machine code of a compiled function that has been called once, for more calls of the same types.

    The compiled function itself looks at the type of each number in its arguments, which takes twice as long as passing
    them. A function that was compiled for several types is returned as it is.
    """
    overloads = list(getattr(compiled, "overloads", {}).values())
    return overloads[0].entry_point if len(overloads) == 1 else compiled


@frozen
class _Compilation:
    """One call of `compile_function`."""

    numba: Any
    """The module; None where nothing is compiled and only the key is asked for."""
    options: CompileOptions
    copies: Counter[types.CodeType] = field(factory=Counter)
    """How often the code of each function would occur if all calls were inlined, once something is compiled."""
    fingerprints: dict[int, str] = field(factory=dict)
    """Those of the functions so far, by identity."""

    def outermost(self, function: types.FunctionType) -> Callable[..., Any]:
        """Return the function compiled. What it calls is looked at once there is no code on disk to load."""
        key = self._key(function, "outermost")
        if key not in _COMPILED:
            named = self._named(function, key)
            # Only the outermost function is kept on disk, since the others are inside it, and only it needs the
            # wrapper for calls from the interpreter, which takes longer to compile than most functions.
            compiled: Any = self.numba.njit(
                named, pipeline_class=_linked_code().OutermostCompiler, **self._flags(function)
            )
            folder = _folder_of(function)
            if folder is None:
                self._bind_all(function, named)
            else:
                prepare = partial(self._bind_all, function, named)
                compiled._cache = _linked_code().KeptCode(named, folder, prepare)
            _COMPILED[key] = compiled
        return _COMPILED[key]

    def _inner(self, function: types.FunctionType, n_places: int) -> Callable[..., Any]:
        """Return a called function compiled; `n_places`: at how many places it is called, 0 where calls are cold."""
        key = self._key(function, "inner" if n_places else "cold")
        if key not in _COMPILED:
            named = self._named(function, key)
            self._bind_called(function, named)
            options = self._flags(function) | self._inline(function.__code__, n_places)
            _COMPILED[key] = self.numba.njit(
                named, no_cpython_wrapper=True, pipeline_class=_linked_code().LinkedCompiler, **options
            )
        return _COMPILED[key]

    def _named(self, function: types.FunctionType, key: str) -> Callable[..., Any]:
        """Return a copy of the function under a name that no other code has."""
        named = bind(function)
        named.__qualname__ = f"{function.__qualname__}_{key.partition(' ')[0]}"
        return named

    def _bind_called(self, function: types.FunctionType, named: Callable[..., Any]) -> None:
        """Have the copy of a function call compiled functions."""
        n_places = times_read(function.__code__)
        inlining = self.options.inlining
        cold = inlining.cold_calls(function) if inlining else ()
        for name, called in called_functions(function, self.options.replacements):
            named.__globals__[name] = self._inner(called, 0 if name in cold else n_places[name])

    def _bind_all(self, function: types.FunctionType, named: Callable[..., Any]) -> None:
        """Have the copy of the outermost function call compiled functions.

        Raises NotCompilable if one of them was replaced since: its code would be kept under the name of other code.
        """
        now = _Compilation(self.numba, self.options)
        if now.digest(function) != self.digest(function):
            raise NotCompilable(
                f"{function.__module__}.{function.__qualname__}, or a function that it calls, was replaced after "
                "`compile_function`: call that again"
            )
        now.copies.update(copies_if_inlined(function, self.options.replacements))
        compiling_begins(function.__name__, sum(len(code.co_code) for code in now.copies))
        now._bind_called(function, named)

    def _key(self, function: types.FunctionType, role: str) -> str:
        return f"{self.digest(function)} {role}"

    def digest(self, function: types.FunctionType) -> str:
        """Return 16 hexadecimal digits that the name of the machine code of this function ends with."""
        digest = hashlib.sha256(fingerprint(function, self.options.replacements, self.fingerprints).encode())
        inlining = self.options.inlining
        hints = () if inlining is None else (inlining.short_code, inlining.long_code)
        uncounted = sorted(code.co_qualname for code in self.options.uncounted)
        digest.update(f"{self._flags(function)} {hints} {uncounted} {_versions()}".encode())
        return digest.hexdigest()[:16]

    def _flags(self, function: types.FunctionType) -> dict[str, Any]:
        flags: dict[str, Any] = {
            "nogil": self.options.releases_lock,
            "no_cfunc_wrapper": True,
            "error_model": self.options.error_model,
        }
        counts = self.options.counts_references and function.__code__ not in self.options.uncounted
        return flags if counts else {**flags, "_nrt": False}

    def _inline(self, code: types.CodeType, n_places: int) -> dict[str, Any]:
        inlining = self.options.inlining
        if inlining is None:
            return {}
        size = len(code.co_code)
        # A call that remains passes all numbers of its tuples, which takes longer than most functions here. So code
        # that would occur once is inlined, and short code is inlined everywhere.
        once = n_places == 1 and (size < inlining.long_code or self.copies[code] == 1)
        return {
            "forceinline": once or (n_places > 0 and size <= inlining.short_code),
            "inline": "always" if n_places == 1 and code in inlining.before_typing else "never",
        }


def _linked_code() -> types.ModuleType:
    """Return the module with the compilers, which imports numba."""
    from graspsense.core.compiling import linked_code

    return linked_code


@cache
def _versions() -> tuple[str, ...]:
    """Return the versions of what machine code depends on. Reading one takes a millisecond."""
    return tuple(version(name) for name in ("numba", "llvmlite", "numpy"))


def _folder_of(function: types.FunctionType) -> Path | None:
    """Return the folder for the code of a function; None for one of a notebook, which changes all the time."""
    return compiled_code_folder() if Path(function.__code__.co_filename).is_file() else None
