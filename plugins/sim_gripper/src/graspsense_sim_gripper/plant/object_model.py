"""The object between the fingers: its numbers, and the laws of its terms, which the composition of a scene binds."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

from graspsense_sim_gripper.plant.pads import PadCompliance

BALANCE_RTOL: Final = 1e-11
"""The least relative tolerance of the balance of forces, which a reference has."""


class ObjectModel(NamedTuple):
    """The object between the fingers, and the pads it is pressed through."""

    width_m: float
    table_friction_n: float
    """Friction of the table, which the finger that touches first has to overcome."""
    pads: PadCompliance
    terms: Any
    """The parameters of the object's terms, in their order."""
    held: int = 0
    """1: the object is held fast. The finger that touches first then presses it instead of pushing it."""
    overshoots: int = 1
    """0: a released object recovers its shape without overshoot, so it cannot touch the fingers again meanwhile."""
    balance_rtol: float = BALANCE_RTOL
    """Relative tolerance of the balance of forces."""


def unbound(*_arguments: Any) -> Any:
    """Raise TypeError: it stands for a part that the composition of a scene binds."""
    raise TypeError("a part is not bound: run.compiled.compose binds the parts of a scene")


object_force: Callable[[Any, Any, float, float, float, float], tuple[float, Any]] = unbound
"""The law of the whole object; the composition of a scene binds it, and the following ones."""
object_phase: Callable[[Any], int] = unbound
"""A number that changes at the events of the terms."""
object_moves: Callable[[Any], bool] = unbound
"""Whether a term moves in a free object (see `Term.moves`)."""
