"""Compiling the loop of a grasp, with the options that suit it; `graspsense.plugin_api.compile_function` does the
work."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from graspsense.plugin_api import CompileOptions, Inlining, compile_function, first_call
from graspsense_sim_gripper import plant
from graspsense_sim_gripper.compiled.compose import Composition, grasp_loop
from graspsense_sim_gripper.exact.propagate import cold_calls
from graspsense_sim_gripper.problem import ControllerStep

OPTIONS: Final = CompileOptions(
    # Nothing here creates an array, and counting references to the arrays that are passed took half of a tick.
    counts_references=False,
    inlining=Inlining(
        short_code=400,
        long_code=2000,
        before_typing=frozenset(
            function.__code__ for function in (plant.move, plant._driven, plant._settled, plant._stepped)
        ),
        cold_calls=cold_calls,
    ),
    install="graspsense-sim-gripper[fast]",
)
_COMPILING: Final = threading.Lock()


def compile_part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a composed function compiled with all that it calls.

    Raises NotCompilable for closures and recursion, and where numba cannot be imported.
    """
    return compile_function(function, OPTIONS)


def compiled_loop(composition: Composition, step: ControllerStep) -> Callable[..., Any]:
    """Return the compiled loop of a composition under a controller with this step. Raises NotCompilable."""
    with _COMPILING:
        return compile_part(grasp_loop(composition, step, interpreted=False))


@contextmanager
def compiling(composition: Composition) -> Iterator[None]:
    """Call a compiled loop inside this context where that may compile it: threads then wait for each other.

    Otherwise each would compile the same. Raises NotCompilable where numba refuses.
    """
    with _COMPILING, first_call(slp_vectorize=composition.shape is not None):
        yield
