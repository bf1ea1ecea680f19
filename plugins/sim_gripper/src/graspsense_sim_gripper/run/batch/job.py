"""Simulating one grasp of a batch, with buffers that the grasps of a thread reuse, and keeping its results."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import define, field, frozen

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
from graspsense_sim_gripper.plant.fingertip import CELL_OFFSET, CELLS
from graspsense_sim_gripper.plant.sensing import PadBuffers, with_listed_cells
from graspsense_sim_gripper.plant.state import PlantState
from graspsense_sim_gripper.run.build import device_info
from graspsense_sim_gripper.run.compiled.compose import grasp_loop, guarded_loop
from graspsense_sim_gripper.run.compiled.loop_code import CompiledLoop
from graspsense_sim_gripper.run.compiled.padding import (
    PaddedLayout,
    composition_of,
    layout_of,
    padded,
    unpadded,
)
from graspsense_sim_gripper.run.drawing import image_noise
from graspsense_sim_gripper.run.loop import (
    COLUMNS,
    NOT_STARTED,
    Buffers,
    Ending,
    GraspParams,
    LoopEnd,
    SimulationState,
    before_failure,
    run_plain,
    uses_macro_steps,
)
from graspsense_sim_gripper.run.model_report import (
    NO_MODEL,
    GraspModel,
    accuracy_report,
    model_report,
    stored_report,
)
from graspsense_sim_gripper.run.nested import Stored
from graspsense_sim_gripper.run.problem import (
    IMAGES_PER_BLOCK,
    GraspController,
    GraspSetup,
)
from graspsense_sim_gripper.run.recorded_trace import recorded_trace
from graspsense_sim_gripper.run.term_failure import not_finite_in_tick, raised_in_term
from graspsense_sim_gripper.scene.random_numbers import Word, key_of
from graspsense_sim_gripper.scene.scaled import ScaledParameter
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS

TICKS: Final = 8200
"""Ticks that the buffers hold at first; a grasp that needs more continues with longer ones. It is not a power of two,
because all columns would then share one set of the processor's cache and evict each other."""
IMAGES: Final = 160
"""Cell images that the buffers hold at first, which suffice for nearly all grasps of the catalogue."""

Extracted = Any
"""What `Job.extract` returns, such as features."""
GraspLoop = CompiledLoop | Callable[[GraspParams, SimulationState, Buffers], SimulationState]
"""The loop of a grasp, compiled or in the interpreter."""
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
    kept: Trace | None
    """The trace; None if traces are not kept."""
    model: GraspModel = NO_MODEL
    """The model in which it was simulated."""
    layout: PaddedLayout | None = None
    """The layout of the terms in `end`; None: they are those of the object."""

    @property
    def state(self) -> PlantState:
        """The plant at the end of the grasp, with the true peak force."""
        end = self.end()
        return end if self.layout is None else unpadded(end, self.layout)

    def report(self) -> dict[str, Any]:
        """Return the `model_report` of the grasp, with what its model does not verify."""
        kinds, reduction, unstable_loop = self.model
        if isinstance(self.end, Stored) and self.layout is not None:
            report = stored_report(self.end.type, self.layout, kinds).report(self.end.numbers)
        else:
            report = model_report(self.state, kinds)
        if reduction is not None:
            report |= accuracy_report(report, reduction, unstable_loop)
        return report

    def in_model(self, model: GraspModel) -> FinishedGrasp:
        """Return the same result, simulated in this model."""
        # `evolve` would take three times as long.
        return FinishedGrasp(
            outcome=self.outcome,
            reason=self.reason,
            end=self.end,
            layout=self.layout,
            extracted=self.extracted,
            kept=self.kept,
            model=model,
        )

    @property
    def trace(self) -> Trace:
        """The trace. Raises ValueError if traces are not kept."""
        if self.kept is None:
            raise ValueError("no traces were asked for: run_many(..., traces=True) keeps them")
        return self.kept


@frozen(kw_only=True, eq=False)
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
    scaled: ScaledParameter | None = None
    """A parameter of the objects that is larger by a share."""
    extraction: CompiledExtraction | None = field(init=False)
    """The form of `extract` that can be compiled; None if there is none, or if traces are kept."""
    ends_with_hold: bool = field()
    """Whether a held grasp ends with its hold, because nothing that is extracted reads its release."""
    params: TickParams = field(init=False)
    """The parameters of controller and guard in every grasp."""
    initial: TickState = field(init=False)
    """The state of controller and guard before the first tick."""

    @extraction.default
    def _extraction(self) -> CompiledExtraction | None:
        return None if self.traces else compiled_extraction(self.extract)

    @ends_with_hold.default
    def _ends_with_hold(self) -> bool:
        return self.extraction is not None and not self.extraction.reads_release

    @params.default
    def _params(self) -> TickParams:
        params = tick_params(device_info(self.config), self.controller, self.run)
        if not self.ends_with_hold:
            return params
        return params._replace(schedule=params.schedule._replace(releases=0))

    @initial.default
    def _initial(self) -> TickState:
        return first_state(self.controller.init())

    @property
    def grasp_controller(self) -> GraspController:
        """The controller with the settings of its runs, and the feature set."""
        return GraspController(self.controller, self.run, self.features)


def _new_buffers() -> Buffers:
    return Buffers(
        pads=PadBuffers(
            left_zero=np.zeros(CELLS),
            right_zero=np.zeros(CELLS),
            noise=np.zeros((IMAGES, 2 * CELLS)),
            images=np.full((IMAGES, 2, CELLS), np.nan),
        ),
        image_times=np.zeros(IMAGES),
        columns=np.zeros((len(COLUMNS), TICKS)),
        phases=np.zeros(TICKS, np.int64),
    )


@define(eq=False)
class Storage:
    """The buffers of a thread. Its grasps use them one after the other."""

    buffers: Buffers = field(factory=_new_buffers)


def grasp_compiled(
    job: Job, setup: GraspSetup, loop: CompiledLoop, storage: Storage, measure: Measure | None = None
) -> FinishedGrasp:
    """Simulate a grasp with the compiled loop of its composition (see `composition_of`).

    `measure`: the compiled form of `Job.extraction`; None: `Job.extract` is called with a trace.
    """
    try:
        whole, layout = padded(setup), layout_of(setup)
        return grasp_once(job, whole, loop, storage, layout=layout, measure=measure)
    except LAW_ERRORS:
        # Compiled code does not say which term raised it.
        return grasp_plain(job, setup)


def grasp_plain(job: Job, setup: GraspSetup) -> FinishedGrasp:
    """Simulate a grasp in the interpreter."""
    composition, step = composition_of(setup, pad=False), type(job.controller).step
    try:
        return grasp_once(job, setup, grasp_loop(composition, step), Storage())
    except LAW_ERRORS as error:
        if not raised_in_term(error, setup.kinds):
            raise
    return grasp_once(job, setup, guarded_loop(composition, step), Storage())


def grasp_once(
    job: Job,
    setup: GraspSetup,
    loop: GraspLoop,
    storage: Storage,
    *,
    layout: PaddedLayout | None = None,
    measure: Measure | None = None,
) -> FinishedGrasp:
    """Grasp what `setup` describes with the loop: on arrays if it is compiled, on lists if it is not.

    `layout`: that in which the grasp is padded; None: it is not. `measure`: as for `grasp_compiled`.
    """
    (ending, state, plant), buffers = _run(job, setup, loop, storage)
    outcome, reason = ended_by_itself(ending.stopped, ending.outcome)
    if ending.failed == 1:
        outcome = Outcome.ABORTED
        effort_n = state().loop.effort_n
        # Once and now: the loop runs again for it, in buffers that the next grasp uses.
        last_plant = plant()
        plant = partial(_same, last_plant)
        reason = not_finite_in_tick(setup.kinds, setup.plant, last_plant, effort_n, setup.dt_s)
    elif ending.ended == 0:
        outcome, reason = Outcome.ABORTED, overdue(job.run)
    done = EndedGrasp(outcome, reason, plant, layout, ending)
    return result_of(job, done, buffers, storage, measure)


def _same(plant: PlantState) -> PlantState:
    return plant


class EndedGrasp(NamedTuple):
    """A grasp that has ended, of which nothing was extracted yet."""

    outcome: Outcome
    reason: str
    plant: Callable[[], PlantState]
    layout: PaddedLayout | None
    """As in `FinishedGrasp`."""
    ending: Ending

    def finished(self, extracted: Extracted, kept: Trace | None) -> FinishedGrasp:
        """Return its result, with what was extracted, and the trace if it is kept."""
        return FinishedGrasp(
            outcome=self.outcome,
            reason=self.reason,
            end=self.plant,
            layout=self.layout,
            extracted=extracted,
            kept=kept,
        )


def result_of(
    job: Job, done: EndedGrasp, buffers: Buffers, storage: Storage, measure: Measure | None
) -> FinishedGrasp:
    """Return the result of a grasp that has been recorded in these buffers; `measure`: as for `grasp_compiled`."""
    on_arrays = isinstance(buffers.columns, np.ndarray)
    if on_arrays:
        storage.buffers = first_images(buffers)
    if not job.traces and job.extract is None:
        return done.finished(None, None)
    n, k, form = done.ending.recorded, done.ending.images, job.extraction
    columns, phases = buffers.columns, buffers.phases
    events = type(job.controller).events
    if measure is not None and form is not None:
        try:
            measured = measure(form.params, columns, phases, n)
        except Exception:
            # Compiled code does not say where an exception comes from. `extract` does, if it raises one too.
            pass
        else:
            return done.finished(form.result(measured), None)
    table, numbers = np.asarray(columns)[:, :n], np.asarray(phases)[:n]
    images, times = np.asarray(buffers.pads.images[:k]), np.asarray(buffers.image_times[:k])
    if job.traces and 2 * n < len(columns[0]):
        trace = recorded_trace(events, table.copy(), numbers.copy(), images, times)
        return done.finished(None if job.extract is None else job.extract(trace), trace)
    # A trace that fills most of the buffers, or that only features are extracted from, is a view of them.
    # While a column of it is referenced, those buffers are kept, and the next grasps have new ones.
    references = sys.getrefcount(columns), sys.getrefcount(phases)
    trace = recorded_trace(events, table, numbers, images, times)
    extracted = None if job.extract is None else job.extract(trace)
    result = done.finished(extracted, trace if job.traces else None)
    del trace, extracted
    if on_arrays and (sys.getrefcount(columns), sys.getrefcount(phases)) != references:
        storage.buffers = first_images(buffers)._replace(
            columns=np.empty_like(columns), phases=np.empty_like(phases)
        )
    return result


def _run(job: Job, setup: GraspSetup, loop: GraspLoop, storage: Storage) -> tuple[LoopEnd, Buffers]:
    """Run the loop to the end of the grasp, with longer buffers where those of the storage do not suffice."""
    ideal, buffers, on_arrays = setup.sensor.ideal == 1, storage.buffers, isinstance(loop, CompiledLoop)
    run = loop.run if isinstance(loop, CompiledLoop) else partial(run_plain, loop)
    if not ideal:
        buffers.pads.noise[:] = setup.noise(0, len(buffers.pads.noise))
    begin_images(buffers)
    if not on_arrays:
        # The interpreter indexes lists faster than arrays.
        buffers = _as_lists(buffers)
    params, progress = started(job, setup, on_arrays=on_arrays)
    most_ticks = params.max_ticks
    while True:
        end = run(params, progress, buffers)
        if end.ending.failed == 1:
            last_plant = partial(before_failure, loop, params, progress, buffers, end.ending.ticks)
            return end._replace(plant=last_plant), buffers
        if end.ending.ended == 1 or end.ending.ticks >= most_ticks:
            return end, buffers
        progress = end.state()
        if not ideal and end.ending.images == len(buffers.pads.images):
            buffers = with_more_images(buffers, key_of(setup.seed))
        else:
            buffers = _with_more_ticks(buffers)
        if not on_arrays:
            buffers = _as_lists(buffers)


def started(job: Job, setup: GraspSetup, *, on_arrays: bool) -> tuple[GraspParams, SimulationState]:
    """Return the parameters of the loop for a grasp, and the state in which it begins."""
    params = GraspParams(
        plant=setup.plant,
        sensor=setup.sensor if on_arrays else with_listed_cells(setup.sensor),
        controller=job.params,
        dt_s=setup.dt_s,
        max_ticks=math.ceil(seconds_at_most(job.run) / setup.dt_s),
        macro_steps=uses_macro_steps(setup.plant.steps),
    )
    return params, SimulationState(NOT_STARTED, setup.state, setup.sensor_state, job.initial)


def _as_lists(buffers: Buffers) -> Buffers:
    pads = PadBuffers(*(np.asarray(array).tolist() for array in buffers.pads))
    return Buffers(pads, *(np.asarray(array).tolist() for array in buffers[1:]))


def begin_images(buffers: Buffers) -> None:
    """Prepare buffers for the cell images of another grasp."""
    buffers.pads.images[-1] = math.nan
    buffers.pads.left_zero[:] = buffers.pads.right_zero[:] = CELL_OFFSET[0]


def with_more_images(buffers: Buffers, key: Word) -> Buffers:
    """Return buffers for more images of a grasp, `key`: that of its seed; they begin with the same values."""
    noise = image_noise(key, len(buffers.pads.images), IMAGES_PER_BLOCK)
    left_zero, right_zero, drawn, images = (np.asarray(array) for array in buffers.pads)
    images = np.concatenate([images, np.zeros((len(noise), 2, CELLS))])
    images[-1] = math.nan
    return buffers._replace(
        pads=PadBuffers(left_zero, right_zero, np.concatenate([drawn, noise]), images),
        image_times=np.concatenate([np.asarray(buffers.image_times), np.zeros(len(noise))]),
    )


def _with_more_ticks(buffers: Buffers) -> Buffers:
    """Return buffers for twice as many ticks; they begin with the same values."""
    columns, phases = np.asarray(buffers.columns), np.asarray(buffers.phases)
    return buffers._replace(
        columns=np.concatenate([columns, np.zeros_like(columns)], axis=1),
        phases=np.concatenate([phases, np.zeros_like(phases)]),
    )


def first_images(buffers: Buffers) -> Buffers:
    """Return the buffers with the images that every grasp begins with, so that none draws noise which it needs not."""
    pads = buffers.pads
    if len(pads.images) == IMAGES:
        return buffers
    return buffers._replace(
        pads=pads._replace(noise=pads.noise[:IMAGES], images=pads.images[:IMAGES]),
        image_times=buffers.image_times[:IMAGES],
    )
