"""The forward model: the force of an object on a recorded path of the gap, through the fingertips and the sensor.

The object's law and the fingertips are those of the simulator (`plant.balance.solve_contact`), compiled where numba
is installed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.simulator_api import NotCompilable, entry_point, first_call
from graspsense_identify.laws import SLOTS, SWITCHED_OFF, CandidateLaw, Values
from graspsense_identify.prepare import Squeeze
from graspsense_sim_gripper.run.identification import (
    BALANCE_RTOL,
    LAW_ERRORS,
    ContactState,
    ObjectModel,
    PadCompliance,
    Switchable,
    compiled_with_laws,
    interpreted_with_laws,
    pad_compression,
    solve_contact,
    uncompressed,
)

Floats = NDArray[np.float64]

RIGID_PADS: Final = PadCompliance(math.inf, 0.0, 0.0, 1.0)
SHORTEST_S: Final = 1e-6
"""The shortest time since a contact in the node after it."""


def forces_along(
    pressed: ObjectModel, at_rest: ContactState, gap_m: Any, speed_m_s: Any, step_s: Any, force_n: Any
) -> None:
    """Write the force at each node of a path to `force_n`.

    The object is at rest until the closure is positive. The contact lies where the closure, at the closing speed of
    that node, was zero.
    """
    now, touched = at_rest, 0
    for i in range(len(gap_m)):
        closure = pressed.width_m - float(gap_m[i])
        speed, h = float(speed_m_s[i]), float(step_s[i])
        if touched == 0 and closure > 0.0:
            touched = 1
            if speed > 0.0:
                h = min(h, max(closure / speed, SHORTEST_S))
        if touched == 1:
            now, _ = solve_contact(pressed, now, closure, speed, h)
        force_n[i] = now.force_n


@cache
def path_forces() -> Callable[..., None]:
    """Return `forces_along` for the terms of all candidates, compiled where that is possible."""
    try:
        compiled = compiled_with_laws(forces_along, SLOTS)
        path = np.linspace(-1e-4, 1e-3, 4)
        with first_call():
            compiled(
                _pressed(RIGID_PADS, 0.05, SWITCHED_OFF), _at_rest(), path, path, path + 1.0, np.zeros(4)
            )
        return entry_point(compiled)
    except NotCompilable:
        return interpreted_with_laws(forces_along, SLOTS)


@cache
def _at_rest() -> ContactState:
    return uncompressed(SLOTS)


def _pressed(pads: PadCompliance, width_m: float, terms: tuple[Switchable, ...]) -> ObjectModel:
    return ObjectModel(
        width_m=width_m,
        table_friction_n=0.0,
        pads=pads,
        terms=terms,
        held=0,
        overshoots=1,
        balance_rtol=BALANCE_RTOL,
    )


@frozen(kw_only=True, eq=False)
class ForwardModel:
    """The fingertips through which the object is pressed."""

    pads: PadCompliance

    def compressed_m(self, force_n: Floats) -> Floats:
        """Return the compression of both fingertips at rest under these forces."""
        return np.array([pad_compression(self.pads, force) for force in force_n.tolist()])

    def at_nodes(
        self, squeeze: Squeeze, law: CandidateLaw, values: Values, width_m: float, factor: float
    ) -> Floats:
        """Return the force (N) at the nodes of a squeeze; NaN where the law has none.

        `values`: of the free parameters. `factor`: on every stiffness.
        """
        forces = np.zeros(len(squeeze.t_s))
        pressed = _pressed(self.pads, width_m, law.terms(values, factor))
        try:
            path_forces()(pressed, _at_rest(), squeeze.gap_m, squeeze.speed_m_s, squeeze.step_s, forces)
        except LAW_ERRORS:
            forces[:] = math.nan
        return forces

    def forces(
        self, squeeze: Squeeze, law: CandidateLaw, values: Values, width_m: float, factor: float
    ) -> Floats:
        """Return the force (N) at the samples of a squeeze; NaN where the law has none."""
        return self.at_nodes(squeeze, law, values, width_m, factor)[squeeze.sample]
