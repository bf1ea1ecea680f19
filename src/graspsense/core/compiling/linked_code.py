"""Compiling a function that only compiled code calls: to code that is linked into its callers, not to machine code.

numba makes machine code of each function, and optimises it, before it links the function into its callers and does both
again there. For a loop that a few hundred functions make up that is half of the time of compiling.
"""

from __future__ import annotations

import os
import re
import types
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined]
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment
from numba.core.typed_passes import NativeLowering


class LinkedLibrary(JITCodeLibrary):
    """The code of a function, to be linked into that of the outermost one."""

    def finalize(self) -> None:
        """Link nothing and make no machine code: the outermost function does both, once for all."""
        self._raise_if_finalized()  # type: ignore[no-untyped-call]
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def _optimize_functions(self, ll_module: Any) -> None:
        """Optimise nothing: the outermost function does it, once for all."""
        ll_module.data_layout = self._codegen._data_layout

    def own_module(self) -> Any:
        """Return the code of this function alone."""
        return super()._get_module_for_linking()  # type: ignore[no-untyped-call]

    def _get_module_for_linking(self) -> Any:
        """Return the code with all that it calls, for a function of numba's own that takes this one as an argument."""
        module = self.own_module().clone()
        for called in _all_called(self):
            module.link_in(called, preserve=True)
        return module


class OutermostLibrary(JITCodeLibrary):
    """The code of a function that the interpreter calls, and of all that it calls."""

    def finalize(self) -> None:
        """Link each function in once, whoever calls it; then optimise, and make machine code."""
        for called in _all_called(self):
            self._final_module.link_in(called, preserve=True)
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._linking_libraries = []
        super().finalize()  # type: ignore[no-untyped-call]

    def _optimize_final_module(self) -> None:
        """Optimise once. numba does so twice, to find counts of references, which most code here has not."""
        passes, builder = self._codegen._module_pass_manager()  # type: ignore[no-untyped-call]
        passes.run(self._final_module, builder)


def _all_called(library: JITCodeLibrary) -> list[Any]:
    """Return the code of every function that this one calls, and that these call, each once."""
    libraries = dict.fromkeys(library._linking_libraries)
    waiting = list(libraries)
    while waiting:
        called = waiting.pop()
        if isinstance(called, LinkedLibrary):
            further = [other for other in called._linking_libraries if other not in libraries]
            libraries.update(dict.fromkeys(further))
            waiting += further
    return [
        called.own_module() if isinstance(called, LinkedLibrary) else called._get_module_for_linking()
        for called in libraries
    ]


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class LinkedLowering(NativeLowering):
    """Lowers a function to code that its callers link in."""

    _name = "linked_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower the function, and register it under an entry point without machine code."""
        super().run_pass(state)  # type: ignore[no-untyped-call]
        described, library = state.cr.fndesc, state.library
        entry_point = _dynfunc.make_function(
            described.lookup_module(),
            described.qualname,
            "linked into its callers",
            0,
            state.cr.env,
            (library,),
        )
        state.targetctx.insert_user_function(entry_point, described, [library])
        state.reload_init.extend(library._reload_init)
        state.cr = state.cr._replace(cfunc=entry_point)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)  # type: ignore[no-untyped-call]
class OutermostLowering(NativeLowering):
    """Lowers a function into which all that it calls is linked."""

    _name = "outermost_lowering"

    def run_pass(self, state: Any) -> bool:
        """Lower the function, and give each linked one its environment, by which it prints and raises with values."""
        super().run_pass(state)  # type: ignore[no-untyped-call]
        library = state.library
        for variable in library._final_module.global_variables:
            environment = lookup_environment(variable.name)  # type: ignore[no-untyped-call]
            if environment is not None:
                library.codegen.set_env(variable.name, environment)
        return True


def _with_lowering(passes: Any, lowering: type[NativeLowering]) -> list[Any]:
    """Return the pipeline with this lowering in place of that of numba."""
    passes.passes = [
        (lowering if compiler_pass is NativeLowering else compiler_pass, name)
        for compiler_pass, name in passes.passes
    ]
    passes.finalize()
    return [passes]


def _keep_in(kind: type[JITCodeLibrary], state: Any) -> None:
    """Have the code of the function that is compiled put into a library of this kind."""
    state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
    state.library.enable_object_caching()


class LinkedCompiler(Compiler):
    """The compiler of a function that only compiled code calls."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes of numba, with `LinkedLowering` in place of its own lowering."""
        self.state.flags.no_compile = True
        _keep_in(LinkedLibrary, self.state)
        (passes,) = super().define_pipelines()  # type: ignore[no-untyped-call]
        return _with_lowering(passes, LinkedLowering)


class OutermostCompiler(Compiler):
    """The compiler of a function that the interpreter calls."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes of numba, with `OutermostLowering` in place of its own lowering."""
        _keep_in(OutermostLibrary, self.state)
        (passes,) = super().define_pipelines()  # type: ignore[no-untyped-call]
        return _with_lowering(passes, OutermostLowering)


class CodeFolder:
    """The folder that code is kept in. A file there is named after its content, so it is never out of date."""

    def __init__(self, folder: Path, source: str) -> None:
        """Take the folder, and the file of the function, which numba names in warnings."""
        self._folder, self._py_file = folder, source

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> None:
        """Return what numba compares to tell whether the source has changed."""

    def ensure_cache_path(self) -> None:
        """Make the folder, should somebody have removed it."""
        self._folder.mkdir(parents=True, exist_ok=True)


class CodeByContent(CompileResultCacheImpl):
    """How numba names and reads the files of a function, whose qualified name ends with the digest of its content."""

    def __init__(self, function: types.FunctionType, folder: Path) -> None:
        """Take the function and the folder, in place of the search of numba for one beside the source."""
        self._lineno = function.__code__.co_firstlineno
        self._locator = CodeFolder(folder, function.__code__.co_filename)
        self._filename_base = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")


class KeptCode(FunctionCache):
    """The machine code of a function on disk. Code that cannot be loaded any more is made anew."""

    def __init__(self, function: Callable[..., Any], folder: Path, prepare: Callable[[], None]) -> None:
        """Take the function, and what makes it ready to be compiled, which takes longer than loading its code."""
        self._impl_class = partial(CodeByContent, folder=folder)  # type: ignore[assignment]
        super().__init__(function)  # type: ignore[no-untyped-call]
        self._prepare, self._is_prepared = prepare, False

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for arguments of these types, or None."""
        code = None
        try:
            code = super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:
            # Another version of a plugin kept it, for arguments of a type that is gone: pickle raises many exceptions.
            self.flush()  # type: ignore[no-untyped-call]
        if code is None and not self._is_prepared:
            self._prepare()
            self._is_prepared = True
        return code

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code in files that nobody else can write to, whatever the mask of the user is."""
        mask = os.umask(0o077)
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        finally:
            os.umask(mask)
