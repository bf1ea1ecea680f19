"""What `graspsense-identify` may use of the simulator: force laws, the contact through the fingertips, the drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

from graspsense_sim_gripper.config import SimConfig as SimConfig
from graspsense_sim_gripper.plant.balance import solve_contact as solve_contact
from graspsense_sim_gripper.plant.drive import Drive as Drive
from graspsense_sim_gripper.plant.drive import stribeck_excess as stribeck_excess
from graspsense_sim_gripper.plant.fingertip import CELLS as CELLS
from graspsense_sim_gripper.plant.object_model import BALANCE_RTOL as BALANCE_RTOL
from graspsense_sim_gripper.plant.object_model import ObjectModel as ObjectModel
from graspsense_sim_gripper.plant.pads import PadCompliance as PadCompliance
from graspsense_sim_gripper.plant.pads import pad_compression as pad_compression
from graspsense_sim_gripper.plant.state import ContactState as ContactState
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.build import drive_and_pads as drive_and_pads
from graspsense_sim_gripper.run.compiled.compose import INTERPRETED, sum_of, sum_of_active
from graspsense_sim_gripper.run.compiled.compose import uncompressed as uncompressed
from graspsense_sim_gripper.run.compiled.jit import compile_part
from graspsense_sim_gripper.scene.terms.registry import active_laws, laws_of
from graspsense_sim_gripper.scene.terms.registry import find_term as find_term
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS as LAW_ERRORS
from graspsense_sim_gripper.scene.terms.term import Switchable as Switchable

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
