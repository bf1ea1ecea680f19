"""Trial grasps of the nominal object, in the steps of one level after another.

A trial grasp uses ideal sensors and the controller of the run. It begins with open fingers and ends with the release.
"""

from __future__ import annotations

import logging
import math
import time
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import define, evolve, field
from numpy.typing import NDArray

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense.plugin_api import HOLD, FeatureSet
from graspsense.simulator_api import (
    NotCompilable,
    TickParams,
    first_state,
    seconds_at_most,
    tick_params,
)
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.state import Motion
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.error import (
    SCALES,
    UNIT_SCALES,
    GraspRecord,
    OwnFeatures,
    beyond,
    own_features,
)
from graspsense_sim_gripper.run.buffers import as_lists, new_buffers
from graspsense_sim_gripper.run.build import Problem
from graspsense_sim_gripper.run.compiled.compose import composition, grasp_loop
from graspsense_sim_gripper.run.compiled.loop_code import CompiledLoops
from graspsense_sim_gripper.run.compiled.padding import padded
from graspsense_sim_gripper.run.loop import (
    COLUMNS,
    EVENT_SHIFT,
    ROWS_AT_ONCE,
    SimulationState,
    before_failure,
    has_ended,
)
from graspsense_sim_gripper.run.problem import GraspController, GraspSetup
from graspsense_sim_gripper.run.term_failure import TermFailed, not_finite_in_tick
from graspsense_sim_gripper.scene.terms.term import switched_off
from graspsense_sim_gripper.solve.scheme import PlantState

_LOG: Final = logging.getLogger(__name__)
MAX_SECONDS: Final = 40.0
"""Longest simulated time of a grasp. One that does not end within it is repeated near the object."""
NEAR_M: Final = 3e-3
"""Distance of the fingers to the object there."""
MAX_HOLD_S: Final = 0.3
"""A longer hold is shortened to this in a trial grasp."""
CAPACITY: Final = 1024
"""Largest number of ticks in a buffer; after each buffer the work is counted."""
MOST_WORK: Final = 1_000_000
"""Largest number of ticks and steps of all trial grasps of one object together: about a minute in the interpreter. It
counts work and not time, so that the model that is chosen does not depend on the machine."""
PROGRESS_S: Final = 3.0
"""Trial grasps that take longer report how far they are, and again after as long."""


class TooMuchWork(Exception):
    """The trial grasps would take more than `MOST_WORK` ticks and steps."""


class TrialGrasp(NamedTuple):
    """A trial grasp in the steps of one level."""

    record: GraspRecord
    features: OwnFeatures | None
    """Those of the pipeline; None: it has none, or ideal sensors do not suffice for them."""


@define(eq=False)
class TrialGrasps:
    """Trial grasps of one object under one controller, each simulated once.

    `compiled` becomes False if the controller or a term turns out not to be compilable.
    """

    config: SimConfig
    setup: GraspSetup
    """The nominal object with all its terms and ideal sensors."""
    controller: GraspController
    params: TickParams
    """Parameters of the controller, from the open fingers to the release."""
    params_near: TickParams
    """The same without opening and release, for a grasp that begins near the object."""
    compiled: bool
    padding: tuple[str, ...] | None
    """The kinds of terms in compiled code, see `compiled.padding`; None: those of a batch."""
    features: FeatureSet[Any] | None = None
    """The feature set of the pipeline; None: only the features of the paper are compared."""
    near: bool = False
    """Whether they begin `NEAR_M` from the object, not with the fingers open."""
    _grasps: dict[Any, TrialGrasp] = field(factory=dict, init=False)
    _loops: CompiledLoops = field(init=False)
    work: int = field(default=0, init=False)
    """Ticks and steps of all trial grasps so far."""
    _reported_s: float = field(factory=time.monotonic, init=False)
    """When progress was reported last."""

    @_loops.default
    def _new_loops(self) -> CompiledLoops:
        return CompiledLoops(self.controller.step)

    def record(self, chosen: ChosenSteps) -> GraspRecord:
        """Return the grasp in these steps."""
        return self._grasp(chosen).record

    def features_beyond(self, chosen: ChosenSteps, full: ChosenSteps) -> tuple[str, ...]:
        """Return the features of the pipeline that differ from those in finer steps by more than the accuracy.

        Empty without a feature set, `error.NOT_READ` for one that ideal sensors do not suffice for.
        """
        if self.features is None:
            return ()
        grasp, expected = self._grasp(chosen), self._grasp(full)
        return beyond(grasp.features, expected.features, self.config.accuracy)

    def values(self, chosen: ChosenSteps) -> dict[str, tuple[float, float]]:
        """Return the features of the pipeline and the peak force in these steps, each with the scale of its unit.

        The features of the paper, if the pipeline has none or ideal sensors do not suffice for them.
        """
        record, own = self._grasp(chosen)
        if own is None:
            return {name: (value, SCALES[name]) for name, value in record.quantities.items()}
        names, values, units = own.features.names, own.features.values, own.features.units
        scales = [UNIT_SCALES.get(unit, 0.0) for unit in units]
        return dict(zip(names, zip(values, scales, strict=True), strict=True)) | {
            "peak": (record.peak_n, SCALES["peak"])
        }

    def _grasp(self, chosen: ChosenSteps) -> TrialGrasp:
        """Return the grasp in these steps, which is simulated once."""
        key = (chosen.steps, chosen.left_out)
        if key not in self._grasps:
            try:
                self._grasps[key] = self._simulated(chosen)
            except NotCompilable:
                self.compiled = False
                self._grasps[key] = self._simulated(chosen)
        return self._grasps[key]

    def _simulated(self, chosen: ChosenSteps) -> TrialGrasp:
        """Return what `_grasp` returns. Raises NotCompilable."""
        setup = evolve(self.setup, plant=chosen.applied_to(self.setup.plant))
        end, rows = self._run(setup)
        if not self.near and not has_ended(end.controller):
            self.near = True
            end, rows = self._run(setup)
        own = None if self.features is None else own_features(self.features, rows[:-1], rows[-1])
        return TrialGrasp(_record(end, rows, setup.dt_s), own)

    def with_setup(self, setup: GraspSetup) -> TrialGrasps:
        """Return trial grasps of another instance of the object, which begin near it and go on counting the work."""
        other = evolve(self, setup=setup, near=True)
        other.work, other._loops = self.work, self._loops
        return other

    def _run(self, setup: GraspSetup) -> tuple[SimulationState, NDArray[np.float64]]:
        """Return the end of a grasp, and its rows: the columns, and last the phases. Raises NotCompilable."""
        most = math.ceil(min(MAX_SECONDS, seconds_at_most(self.controller.run)) / setup.dt_s)
        made = padded(setup, self.padding) if self.compiled else setup
        composed = composition(made.kinds, made.plant)
        loop = self._loops.loop_of(composed) if self.compiled else grasp_loop(composed, self.controller.step)
        controller = first_state(self.controller.controller.init())
        params, progress = made.begun(self.params_near if self.near else self.params, controller, most)
        if self.near:
            progress = progress._replace(plant=_near(made))
        rows = []
        while not has_ended(progress.controller) and progress.loop.tick.ticks < most:
            arrays = new_buffers(CAPACITY + ROWS_AT_ONCE, images=1)
            written = arrays if self.compiled else as_lists(arrays)
            last = progress.loop.tick._replace(recorded=0)
            start = progress._replace(loop=progress.loop._replace(tick=last))
            progress = loop(params, start, written)
            if progress.loop.failed == 1:
                last_plant = before_failure(loop, params, start, written, progress.loop.tick.ticks)
                raise TermFailed(
                    not_finite_in_tick(
                        made.kinds, made.plant, last_plant, progress.loop.tick.effort_n, setup.dt_s
                    )
                )
            n = progress.loop.tick.recorded
            rows.append(np.vstack((np.asarray(written.columns)[:, :n], np.asarray(written.phases)[:n])))
            self._count(start, progress)
        return progress, np.concatenate(rows, axis=1)

    def _count(self, start: SimulationState, end: SimulationState) -> None:
        """Count the work between two states. Raises TooMuchWork."""
        self.work += end.loop.tick.ticks - start.loop.tick.ticks
        self.work += end.plant.step.n_steps - start.plant.step.n_steps
        if self.work > MOST_WORK:
            raise TooMuchWork
        percent = 100 * self.work // MOST_WORK
        # Compiling takes seconds too, but no work.
        if percent > 0 and time.monotonic() - self._reported_s > PROGRESS_S:
            _LOG.warning(
                "choosing the time steps of the simulation: %d %% of the longest search done",
                percent,
            )
            self._reported_s = time.monotonic()


def trial_grasps(
    problem: Problem, controller: GraspController, *, compiled: bool, padding: tuple[str, ...] | None
) -> TrialGrasps:
    """Return the trial grasps of a problem. Raises TypeError if there is no object."""
    law, run = controller.controller, evolve(controller.run, hold_s=min(controller.run.hold_s, MAX_HOLD_S))
    near = evolve(problem.device, opening=None)
    return TrialGrasps(
        config=evolve(problem.model_config, spread=False),
        setup=problem.nominal,
        controller=controller,
        params=tick_params(problem.device, law, run),
        params_near=tick_params(near, law, run),
        compiled=compiled,
        padding=padding,
        features=controller.features,
    )


def _near(setup: GraspSetup) -> PlantState:
    """Return the plant with the fingers at rest, `NEAR_M` from the object."""
    state, link = setup.state, setup.plant.drive.link
    # The gap at which the nearer finger touches the object.
    reach_m = setup.plant.object.width_m + 2.0 * abs(state.contact.offset_m)
    near = revolutions_at(link, min(state.motion.gap_m, reach_m + NEAR_M))
    return state._replace(motion=Motion(near, 0.0, *gap_and_rate(link, near)))


def _record(end: SimulationState, rows: NDArray[np.float64], dt_s: float) -> GraspRecord:
    """Return the record of a grasp with these rows: the columns, and last the phases."""
    phases = np.mod(rows[-1], 1 << EVENT_SHIFT)
    columns = dict(zip(COLUMNS, rows, strict=False))
    return GraspRecord(
        outcome=int(end.controller.law.outcome) if end.controller.guard.stopped == 0 else -1,
        dt_s=dt_s,
        gap_m=columns["gap_m"],
        speed_m_s=columns["velocity_m_s"],
        left_n=columns["force_left_n"],
        right_n=columns["force_right_n"],
        n_rows=int(np.sum(phases <= HOLD)),
        hold_from=int(np.sum(phases < HOLD)),
        peak_n=end.plant.peak_n,
    )


def without_term(setup: GraspSetup, i: int) -> GraspSetup:
    """Return the same grasp of the object without its term `i`."""
    model = setup.plant.object
    model = model._replace(terms=switched_off(model.terms, (i,)))
    return evolve(setup, plant=setup.plant._replace(object=model))
