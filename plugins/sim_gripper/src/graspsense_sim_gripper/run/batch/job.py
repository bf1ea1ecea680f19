"""The settings of a batch, its grasps in the interpreter, and what is kept of a grasp."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from attrs import field, frozen

from graspsense.gripper_api import Outcome
from graspsense.plugin_api import Controller, FeatureSet, Trace
from graspsense.simulator_api import (
    CompiledExtraction,
    RunConfig,
    TickParams,
    TickState,
    compiled_extraction,
    ended_by_itself,
    first_state,
    overdue,
    seconds_at_most,
    tick_params,
)
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.sensing import with_listed_cells
from graspsense_sim_gripper.run.buffers import as_lists, begin_images, longer, new_buffers, recorded_trace
from graspsense_sim_gripper.run.build import device_info
from graspsense_sim_gripper.run.compiled.compose import composition, grasp_loop
from graspsense_sim_gripper.run.compiled.padding import unpadded
from graspsense_sim_gripper.run.loop import (
    Buffers,
    Ending,
    GraspParams,
    SimulationState,
    before_failure,
    ending,
)
from graspsense_sim_gripper.run.model_report import (
    NO_MODEL,
    GraspModel,
    accuracy_report,
    model_report,
    stored_report,
)
from graspsense_sim_gripper.run.nested import Stored
from graspsense_sim_gripper.run.problem import GraspController, GraspSetup
from graspsense_sim_gripper.run.term_failure import not_finite_in_tick
from graspsense_sim_gripper.scene.random_numbers import key_of
from graspsense_sim_gripper.solve.scheme import PlantState

Extracted = Any
"""What `Job.extract` returns, such as features."""
Measure = Callable[[Any, Any, Any, int], Any]
"""`compiled.extraction.measure_buffers` of a job, compiled."""


@frozen(kw_only=True, eq=False)
class FinishedGrasp:
    """The result of one grasp of a batch."""

    outcome: Outcome
    reason: str
    end: Callable[[], PlantState]
    """Returns the plant at the end of the grasp, as its loop returned it."""
    extracted: Extracted
    """What `Job.extract` returned for the trace; None if there is no `Job.extract`."""
    trace: Trace | None
    """None if traces are not kept."""
    model: GraspModel = NO_MODEL
    """The model in which it was simulated."""
    terms: tuple[int, ...] | None = None
    """The places of the object's own terms in `end`; None: it has no others."""

    @property
    def state(self) -> PlantState:
        """The plant at the end of the grasp, with the true peak force."""
        end = self.end()
        return end if self.terms is None else unpadded(end, self.terms)

    def report(self) -> dict[str, Any]:
        """Return the `model_report` of the grasp, with what its model does not verify."""
        kinds, chosen, unstable_loop = self.model
        if isinstance(self.end, Stored) and self.terms is not None:
            report = stored_report(self.end, self.terms, kinds)
        else:
            report = model_report(self.state, kinds)
        if chosen is not None:
            report |= accuracy_report(report, chosen, unstable_loop)
        return report


@frozen(kw_only=True, eq=False, slots=False)
class Job:
    """The settings that all grasps of a batch share."""

    config: SimConfig
    controller: Controller[Any]
    run: RunConfig
    extract: Callable[[Trace], Extracted] | None
    """Called with each trace, for example to compute features; its result is `FinishedGrasp.extracted`."""
    traces: bool
    """Whether traces are kept."""
    features: FeatureSet[Any] | None = None
    """The feature set whose features are verified where a model is selected."""
    ends_with_hold: bool = field()
    """Whether a held grasp ends with its hold, because nothing that is extracted reads its release."""

    @ends_with_hold.default
    def _ends_with_hold(self) -> bool:
        return self.extraction is not None and not self.extraction.reads_release

    @cached_property
    def extraction(self) -> CompiledExtraction | None:
        """The form of `extract` that can be compiled; None if there is none, or if traces are kept."""
        return None if self.traces else compiled_extraction(self.extract)

    @cached_property
    def params(self) -> TickParams:
        """The parameters of controller and guard in every grasp."""
        params = tick_params(device_info(self.config), self.controller, self.run)
        if not self.ends_with_hold:
            return params
        return params._replace(schedule=params.schedule._replace(releases=0))

    @cached_property
    def initial(self) -> TickState:
        """The state of controller and guard before the first tick."""
        return first_state(self.controller.init())

    @cached_property
    def max_ticks(self) -> int:
        """The most ticks of a grasp."""
        return math.ceil(seconds_at_most(self.run) / (1.0 / self.config.rate_hz))

    @property
    def grasp_controller(self) -> GraspController:
        """The controller with the settings of its runs, and the feature set."""
        return GraspController(self.controller, self.run, self.features)


def grasp_plain(job: Job, setup: GraspSetup, model: GraspModel = NO_MODEL) -> FinishedGrasp:
    """Simulate a grasp in the interpreter; `model`: that of its object, for the report."""
    loop = grasp_loop(composition(setup.kinds, setup.plant), type(job.controller).step)
    params, state = started(job, setup)
    params = params._replace(sensor=with_listed_cells(setup.sensor))
    key, arrays = None, new_buffers()
    if setup.sensor.ideal == 0:
        key = key_of(setup.seed)
        arrays.pads.noise[:] = setup.noise(0, len(arrays.pads.noise))
    begin_images(arrays)
    buffers = as_lists(arrays)
    while True:
        begun, state = state, loop(params, state, buffers)
        end = ending(state)
        if end.failed == 1 or end.ended == 1 or end.ticks >= params.max_ticks:
            break
        buffers = as_lists(longer(buffers, key))
    plant = state.plant
    outcome, reason = ended_as(job, end)
    if end.failed == 1:
        plant = before_failure(loop, params, begun, buffers, end.ticks)
        reason = not_finite_in_tick(setup.kinds, setup.plant, plant, state.loop.tick.effort_n, setup.dt_s)
    extracted, kept = extracted_from(job, buffers, end)
    return FinishedGrasp(
        outcome=outcome,
        reason=reason,
        end=lambda: plant,
        extracted=extracted,
        trace=kept,
        model=model,
    )


def started(job: Job, setup: GraspSetup) -> tuple[GraspParams, SimulationState]:
    """Return the parameters of the loop for a grasp, and the state in which it begins."""
    return setup.begun(job.params, job.initial, job.max_ticks)


def ended_as(job: Job, end: Ending) -> tuple[Outcome, str]:
    """Return the outcome of a grasp, and its reason if no term has failed."""
    if end.failed == 1:
        return Outcome.ABORTED, ""
    if end.ended == 0:
        return Outcome.ABORTED, overdue(job.run)
    return ended_by_itself(end.stopped, end.outcome)


def extracted_from(
    job: Job, buffers: Buffers, end: Ending, measure: Measure | None = None
) -> tuple[Extracted, Trace | None]:
    """Return what `Job.extract` gives for a grasp that was recorded in these buffers, and its trace if it is kept.

    `measure`: the compiled form of `Job.extraction`; None: `Job.extract` is called with a trace.
    """
    if not job.traces and job.extract is None:
        return None, None
    n, k, form = end.recorded, end.images, job.extraction
    if measure is not None and form is not None:
        try:
            measured = measure(form.params, buffers.columns, buffers.phases, n)
        except Exception:
            # Compiled code does not say where an exception comes from. `extract` does, if it raises one too.
            pass
        else:
            return form.result(measured), None
    trace = recorded_trace(
        type(job.controller).events,
        # Copies, since the next grasp is recorded in the same buffers.
        np.asarray(buffers.columns)[:, :n].copy(),
        np.asarray(buffers.phases)[:n].copy(),
        np.asarray(buffers.pads.images[:k]),
        np.asarray(buffers.image_times[:k]),
    )
    return None if job.extract is None else job.extract(trace), trace if job.traces else None
