"""Compiling the loop of a grasp with numba: the options for `graspsense.simulator_api.compile_function`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from graspsense.simulator_api import CompileOptions, Inlining, compile_function, first_call
from graspsense_sim_gripper.plant.balance import solve_contact
from graspsense_sim_gripper.plant.contact import _pressed
from graspsense_sim_gripper.solve.advance import advance, move, take_step, take_steps
from graspsense_sim_gripper.solve.converge import refine_until_converged

_REMAIN_CALLS: Final = {
    # The laws of the object are called through the contact: inlined, they would be compiled once per call.
    _pressed.__code__: ("solve_contact",),
    solve_contact.__code__: ("_release_from_rigid_pads",),
    # These are rarely called: inlined, they would take registers from velocity Verlet.
    take_step.__code__: ("stick", "restarted"),
}


def _remaining_calls(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names of the functions that are not inlined in the code of this one."""
    return _REMAIN_CALLS.get(function.__code__, ())


OPTIONS: Final = CompileOptions(
    # No code here creates an array, and counting references to the arguments took half of the time of a tick.
    counts_references=False,
    inlining=Inlining(
        short_code=400,
        long_code=2000,
        before_typing=frozenset(
            function.__code__ for function in (move, advance, refine_until_converged, take_steps)
        ),
        cold_calls=_remaining_calls,
    ),
    install="graspsense-sim-gripper[fast]",
)
COMPILING: Final = threading.Lock()
"""Held while code is compiled."""


def compile_part(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a composed function, compiled with all functions that it calls.

    Raises NotCompilable for closures and recursion, and if numba cannot be imported.
    """
    return compile_function(function, OPTIONS)


@contextmanager
def generating() -> Iterator[None]:
    """Context as of `first_call`, for a call of a compiled function that may be its first.

    Threads wait for each other here, so that the code is not generated twice. Raises NotCompilable if numba refuses.
    """
    with COMPILING, first_call():
        yield
