"""The forward model: the force of an object on a recorded path of the gap, through the fingertips and the sensor.

The object's law and the fingertips are those of the simulator (`dynamics.contact.solve_contact`), compiled where numba
is installed. A direct fit uses the same function with rigid fingertips, on a path of the compression.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import NotCompilable, entry_point, first_call
from graspsense_sim_gripper.binding import bind_reachable
from graspsense_sim_gripper.compiled.compose import (
    INTERPRETED,
    pad_parts,
    sum_of,
    sum_of_active,
    uncompressed,
)
from graspsense_sim_gripper.compiled.jit import compile_part
from graspsense_sim_gripper.dynamics.contact import (
    ObjectModel,
    PadCompliance,
    pad_compression,
    solve_contact,
)
from graspsense_sim_gripper.dynamics.state import ContactState
from graspsense_sim_gripper.identify.laws import SLOTS, CandidateLaw
from graspsense_sim_gripper.identify.prepare import Squeeze
from graspsense_sim_gripper.terms.registry import active_laws, laws_of
from graspsense_sim_gripper.terms.term import LAW_ERRORS

Floats = NDArray[np.float64]
PathForces = Callable[[ObjectModel, ContactState, Any, Any, Any, Any], None]

RIGID_PADS: Final = PadCompliance(math.inf, 0.0, 0.0, 1.0)
TABLE: Final = 400
LARGEST_N: Final = 1000.0
"""Entries, and the largest force, of the table of the compression of nonlinear fingertips."""
SHORTEST_S: Final = 1e-6
"""The shortest time since a contact in the node after it."""


def forces_along(
    model: ObjectModel, at_rest: ContactState, closure_m: Any, speed_m_s: Any, step_s: Any, force_n: Any
) -> None:
    """Write the force at each node of a path of the closure to `force_n`; arrays or lists of equal length.

    The object is at rest until the closure is positive. The contact lies where the closure, at the closing speed of
    that node, was zero.
    """
    now, touched = at_rest, 0
    for i in range(len(closure_m)):
        closure, h = closure_m[i], step_s[i]
        if touched == 0 and closure > 0.0:
            touched = 1
            if speed_m_s[i] > 0.0:
                h = min(h, max(closure / speed_m_s[i], SHORTEST_S))
        if touched == 1:
            now, _ = solve_contact(model, now, closure, speed_m_s[i], h)
        force_n[i] = now.force_n


@cache
def path_forces(hardens: bool) -> tuple[PathForces, bool]:
    """Return `forces_along` for the terms of all candidates, and whether it is compiled.

    `hardens`: whether the fingertips are nonlinear.
    """
    parts = pad_parts(hardens)
    try:
        compiled = compile_part(
            bind_reachable(forces_along, {"object_force": sum_of(laws_of(SLOTS)), **parts})
        )
        model = ObjectModel(0.05, 0.0, RIGID_PADS, _some_terms(), 0, 1)
        path = np.linspace(-1e-4, 1e-3, 4)
        with first_call():
            compiled(model, uncompressed(SLOTS), path, path, path + 1.0, np.zeros(4))
        return entry_point(compiled), True
    except NotCompilable:
        force = sum_of_active(active_laws(SLOTS))
        return bind_reachable(forces_along, {"object_force": force, **parts}, INTERPRETED), False


@cache
def _at_rest() -> ContactState:
    return uncompressed(SLOTS)


def _some_terms() -> tuple[Any, ...]:
    from graspsense_sim_gripper.identify.laws import ELASTIC, FreeParameter

    k1 = FreeParameter(slot=ELASTIC, name="k1_n_m", low=1.0, high=2.0, starts=(1.0,))
    return CandidateLaw(free=(k1,)).terms((1.0,))


@frozen(kw_only=True, eq=False)
class ForwardModel:
    """The fingertips through which the object is pressed, and whether the path is direct.

    `direct`: the compression is computed from the measured force, so that the fingertips need no solution. That is
    fast and has no local minima of its own; noise and lag of the force bias it.
    """

    pads: PadCompliance
    direct: bool = False

    @property
    def _hardens(self) -> bool:
        return self.pads.hardening_m < math.inf

    def compile(self) -> None:
        """Compile what a direct and a forward fit need, before several threads call it."""
        path_forces(False)
        path_forces(self._hardens)

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        """Forces (N), and the compression (m) of both fingertips under them."""
        forces = np.concatenate([[0.0], np.geomspace(1e-3, LARGEST_N, TABLE)])
        return forces, np.array([pad_compression(self.pads, float(one)) for one in forces])

    @cached_property
    def _compliance(self) -> tuple[Floats, Floats]:
        """Forces (N), and the derivative of that compression (m/N)."""
        forces, compressions = self._table
        return forces, np.gradient(compressions, forces)

    def compressed_m(self, force_n: Floats) -> Floats:
        """Return the compression of both fingertips at rest under these forces."""
        if self.pads.hardening_m == math.inf:
            return force_n / self.pads.stiffness_n_m
        return np.interp(force_n, *self._table)

    def forces(
        self,
        squeeze: Squeeze,
        candidate: CandidateLaw,
        values: Sequence[float],
        width_m: float,
        factor: float,
    ) -> Floats:
        """Return the force (N) at the samples of a squeeze; NaN where a law has none."""
        run, compiled = path_forces(self._hardens and not self.direct)
        closure, speed, pads = width_m - squeeze.gap_m, squeeze.speed_m_s, self.pads
        if self.direct:
            if math.isfinite(pads.stiffness_n_m):
                force, rate = squeeze.measured_path
                closure = closure - self.compressed_m(force)
                speed = speed - rate * np.interp(force, *self._compliance)
            pads = RIGID_PADS
        model = ObjectModel(width_m, 0.0, pads, candidate.terms(values, factor), 0, 1)
        out: Any = np.zeros(len(closure))
        try:
            if compiled:
                run(model, _at_rest(), closure, speed, squeeze.step_s, out)
            else:
                out = out.tolist()
                run(model, _at_rest(), closure.tolist(), speed.tolist(), squeeze.step_s.tolist(), out)
                out = np.array(out)
        except LAW_ERRORS:
            out = np.full(len(closure), math.nan)
        forces: Floats = out[squeeze.sample]
        return forces
