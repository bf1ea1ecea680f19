"""The forward model: the force of an object on a recorded path of the gap, through the fingertips and the sensor.

The object's law and the fingertips are those of the simulator (`dynamics.contact.solve_contact`), compiled where numba
is installed. One call computes many paths, so that the interpreter costs little beside them. A direct fit uses the same
function with rigid fingertips, on a path of the compression.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.simulator_api import NotCompilable, entry_point, first_call
from graspsense_identify.laws import N_NUMBERS, SLOTS, CandidateLaw, terms_of
from graspsense_identify.prepare import Squeeze
from graspsense_sim_gripper.run.identification import (
    BALANCE_RTOL,
    LAW_ERRORS,
    ContactState,
    ObjectModel,
    PadCompliance,
    compiled_with_laws,
    interpreted_with_laws,
    pad_compression,
    solve_contact,
    uncompressed,
)

Floats = NDArray[np.float64]

RIGID_PADS: Final = PadCompliance(math.inf, 0.0, 0.0, 1.0)
TABLE: Final = 400
LARGEST_N: Final = 1000.0
"""Entries, and the largest force, of the table of the compression of nonlinear fingertips."""
SHORTEST_S: Final = 1e-6
"""The shortest time since a contact in the node after it."""


class Paths(NamedTuple):
    """The paths of several squeezes, one after another in each array; `starts` is where each begins, and the end."""

    gap_m: Any
    speed_m_s: Any
    step_s: Any
    starts: Any


class Runs(NamedTuple):
    """What is computed: a row for each run, which follows a path with a width and numbers of the terms."""

    path: Any
    """Number of the path."""
    width_m: Any
    numbers: Any
    """(runs, `N_NUMBERS`), as `terms_of` reads them."""
    active: Any
    """Whether each of the slots is active (1), the same in all runs."""


PathForces = Callable[[PadCompliance, ContactState, Paths, Runs, Any], None]


def forces_along(pads: PadCompliance, at_rest: ContactState, paths: Paths, runs: Runs, force_n: Any) -> None:
    """Write the force at each node of the path of each run to its row of `force_n`.

    The object is at rest until the closure is positive. The contact lies where the closure, at the closing speed of
    that node, was zero.
    """
    for r in range(len(runs.path)):
        width = float(runs.width_m[r])
        model = ObjectModel(width, 0.0, pads, terms_of(runs.active, runs.numbers, r), 0, 1, BALANCE_RTOL)
        begin, end = paths.starts[runs.path[r]], paths.starts[runs.path[r] + 1]
        now, touched = at_rest, 0
        for i in range(begin, end):
            closure, speed, h = (
                width - float(paths.gap_m[i]),
                float(paths.speed_m_s[i]),
                float(paths.step_s[i]),
            )
            if touched == 0 and closure > 0.0:
                touched = 1
                if speed > 0.0:
                    h = min(h, max(closure / speed, SHORTEST_S))
            if touched == 1:
                now, _ = solve_contact(model, now, closure, speed, h)
            force_n[r, i - begin] = now.force_n


@cache
def path_forces(hardens: bool) -> tuple[PathForces, bool]:
    """Return `forces_along` for the terms of all candidates, and whether it is compiled.

    `hardens`: whether the fingertips are nonlinear.
    """
    try:
        compiled = compiled_with_laws(forces_along, SLOTS, hardens=hardens)
        path = np.linspace(-1e-4, 1e-3, 4)
        paths = Paths(path, path, path + 1.0, np.array([0, 4]))
        active = np.zeros(len(SLOTS), np.int64)
        runs = Runs(np.zeros(1, np.int64), np.full(1, 0.05), np.ones((1, N_NUMBERS)), active)
        with first_call():
            compiled(RIGID_PADS, uncompressed(SLOTS), paths, runs, np.zeros((1, 4)))
        return entry_point(compiled), True
    except NotCompilable:
        return interpreted_with_laws(forces_along, SLOTS, hardens=hardens), False


@cache
def _at_rest() -> ContactState:
    return uncompressed(SLOTS)


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
        return forces, np.array([pad_compression(self.pads, float(force)) for force in forces])

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

    def paths(self, squeezes: Sequence[Squeeze]) -> Paths:
        """Return the paths of these squeezes: of the gap, or of the compression in a direct fit."""
        gaps, speeds = [], []
        for squeeze in squeezes:
            gap, speed = squeeze.gap_m, squeeze.speed_m_s
            if self.direct and math.isfinite(self.pads.stiffness_n_m):
                force, rate = squeeze.measured_path
                gap = gap + self.compressed_m(force)
                speed = speed - rate * np.interp(force, *self._compliance)
            gaps.append(gap)
            speeds.append(speed)
        starts = np.cumsum([0, *(len(squeeze.t_s) for squeeze in squeezes)])
        steps = np.concatenate([squeeze.step_s for squeeze in squeezes])
        return Paths(np.concatenate(gaps), np.concatenate(speeds), steps, starts)

    def run(self, paths: Paths, runs: Runs) -> Floats:
        """Return the force (N) at the nodes of the path of each run, a row for each; NaN where a law has none."""
        follow, compiled = path_forces(self._hardens and not self.direct)
        pads = RIGID_PADS if self.direct else self.pads
        out = np.zeros((len(runs.path), int(np.max(np.diff(paths.starts)))))
        if compiled:
            follow(pads, _at_rest(), paths, runs, out)
            return out
        for r in range(len(runs.path)):
            alone = Runs(runs.path[r : r + 1], runs.width_m[r : r + 1], runs.numbers[r : r + 1], runs.active)
            try:
                follow(pads, _at_rest(), paths, alone, out[r : r + 1])
            except LAW_ERRORS:
                out[r] = math.nan
        return out

    def forces(
        self,
        squeeze: Squeeze,
        candidate: CandidateLaw,
        values: Sequence[float],
        width_m: float,
        factor: float,
    ) -> Floats:
        """Return the force (N) at the samples of a squeeze; NaN where a law has none."""
        numbers = candidate.numbers(np.array([values]), np.array([factor]))
        runs = Runs(np.zeros(1, np.int64), np.array([width_m]), numbers, candidate.active)
        return squeeze.at_samples(self.run(self.paths([squeeze]), runs)[0])
