"""What `graspsense-identify` may use of the simulator: force laws, the contact through the fingertips, the drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.balance import solve_contact
from graspsense_sim_gripper.plant.drive import Drive, stribeck_excess
from graspsense_sim_gripper.plant.fingertip import CELLS
from graspsense_sim_gripper.plant.object_model import BALANCE_RTOL, ObjectModel
from graspsense_sim_gripper.plant.pads import PadCompliance, pad_compression
from graspsense_sim_gripper.plant.state import ContactState
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.build import drive_and_pads
from graspsense_sim_gripper.run.compiled.compose import (
    INTERPRETED,
    sum_of,
    sum_of_active,
    uncompressed,
)
from graspsense_sim_gripper.run.compiled.jit import compile_part
from graspsense_sim_gripper.scene.terms.registry import active_laws, find_term, laws_of
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS, Switchable

__all__ = [
    "BALANCE_RTOL",
    "CELLS",
    "LAW_ERRORS",
    "ContactState",
    "Drive",
    "ObjectModel",
    "PadCompliance",
    "SimConfig",
    "Switchable",
    "compiled_with_laws",
    "drive_and_pads",
    "find_term",
    "interpreted_with_laws",
    "pad_compression",
    "solve_contact",
    "stribeck_excess",
    "uncompressed",
]

FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def compiled_with_laws(function: FunctionT, kinds: Sequence[str]) -> FunctionT:
    """Return a function that calls `solve_contact`, compiled with the force laws of these kinds of terms.

    Raises NotCompilable, at the first call at the latest.
    """
    force = sum_of(laws_of(kinds))
    return cast("FunctionT", compile_part(bind_reachable(function, {"object_force": force})))


def interpreted_with_laws(function: FunctionT, kinds: Sequence[str]) -> FunctionT:
    """Return the same function for the interpreter, which skips the terms that are switched off."""
    return bind_reachable(function, {"object_force": sum_of_active(active_laws(kinds))}, INTERPRETED)
