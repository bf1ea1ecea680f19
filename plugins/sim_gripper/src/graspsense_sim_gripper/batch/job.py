"""One grasp of many: the loop of `kernel` on storage that the grasps of a thread share, and what is kept of it."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import define, field, frozen

from graspsense.plugin_api import (
    CELLS,
    Controller,
    Outcome,
    RunConfig,
    TickParams,
    TickState,
    Trace,
    ended_by_itself,
    first_state,
    overdue,
    seconds_at_most,
    tick_params,
)
from graspsense_sim_gripper.checking import Checking, Control, Loops
from graspsense_sim_gripper.compiled.padding import as_compiled, as_own, layout_of
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.dynamics.state import PlantState
from graspsense_sim_gripper.exact.discretise import discretise
from graspsense_sim_gripper.exact.modes import Shape
from graspsense_sim_gripper.kernel import grasp_of
from graspsense_sim_gripper.loop import (
    COLUMNS,
    NOT_STARTED,
    Buffers,
    GraspParams,
    Progress,
    has_ended,
)
from graspsense_sim_gripper.sensing import PadBuffers
from graspsense_sim_gripper.setting import CELL_OFFSET, Chooser, Setting, device_info, set_scene
from graspsense_sim_gripper.terms.registry import laws_of

TICKS: Final = 8200
"""Room for ticks; a grasp that needs more is given more on the way. Columns a power of two apart would all fall into
one set of a processor's cache, and drive each other out of it."""
IMAGES: Final = 128


@frozen(kw_only=True, eq=False)
class Done:
    """One grasp of many: how it ended, and the plant at the end (the true peak force is in it).

    `extracted` is what `Job.extract` returned for its trace; the trace itself is there where it was asked for.
    """

    outcome: Outcome
    reason: str
    body: PlantState
    extracted: Any
    kept: Trace | None

    @property
    def trace(self) -> Trace:
        """The trace; ValueError where none was asked for."""
        if self.kept is None:
            raise ValueError("no traces were asked for: run_many(..., traces=True) keeps them")
        return self.kept


@frozen(kw_only=True, eq=False)
class Job:
    """What all grasps of a batch have in common."""

    config: SimConfig
    controller: Controller[Any]
    run: RunConfig
    extract: Callable[[Trace], Any] | None
    traces: bool
    params: TickParams = field(init=False)
    """The numbers of every grasp, and the state that each begins with."""
    begins: TickState = field(init=False)

    @params.default
    def _numbers(self) -> TickParams:
        return tick_params(device_info(self.config), self.controller, self.run)

    @begins.default
    def _first(self) -> TickState:
        return first_state(self.controller.init())


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
    """The buffers of a thread, which its grasps use one after the other."""

    buffers: Buffers = field(factory=_new_buffers)


class Composition(NamedTuple):
    """What a loop is made for: the terms of the object, and the exact maps that take its ticks, if any do."""

    kinds: tuple[str, ...]
    shape: Shape | None
    """Of the exact maps that take its ticks."""
    settles: bool
    """Whether its steps are to settle."""


def composition_of(config: SimConfig, setting: Setting) -> Composition:
    """Return the composition in which this grasp is compiled."""
    return _composed(config, setting, layout_of(setting).kinds)


def _composed(config: SimConfig, setting: Setting, kinds: tuple[str, ...]) -> Composition:
    return Composition(kinds, _shape(config, setting), setting.plant.steps.settle > 0.0)


def _shape(config: SimConfig, setting: Setting) -> Shape | None:
    found = discretise(config, setting, on_arrays=True)
    return None if found is None else found[1]


@lru_cache(maxsize=64)
def loop_of(composition: Composition, step: Callable[..., Any]) -> Callable[..., Any]:
    """Return the loop for this composition under this law, in plain Python."""
    kinds, shape, settles = composition
    return grasp_of(laws_of(kinds), step, by_maps=None if shape is None else (kinds, shape), settles=settles)


def grasp_once(
    job: Job,
    setting: Setting,
    loop: Callable[..., Any],
    storage: Storage,
    *,
    on_arrays: bool,
    own: Setting | None = None,
) -> Done:
    """Grasp what `setting` describes by `loop`, on arrays where it is compiled, on lists where it is plain.

    `own`: the same grasp with the object's own terms, where the setting is that of another composition.
    """
    end, buffers = _run(job, setting, loop, storage, on_arrays)
    if on_arrays:
        storage.buffers = buffers
    body = end.plant if own is None else as_own(end.plant, own)
    outcome, reason = ended_by_itself(end.controller)
    if not has_ended(end.controller):
        outcome, reason = Outcome.ABORTED, overdue(job.run)
    if not job.traces and job.extract is None:
        return done_of(job, outcome, reason, body, None)
    n, k = end.loop.recorded, end.sensor.images
    columns, phases = buffers.columns, buffers.phases
    table, numbers = np.asarray(columns)[:, :n], np.asarray(phases)[:n]
    images, times = buffers.pads.images[:k], buffers.image_times[:k]
    if job.traces and 2 * n < len(columns[0]):
        return done_of(job, outcome, reason, body, _trace(table.copy(), numbers.copy(), images, times))
    # A trace that fills most of the buffers, or that only features are extracted from, is a view of them. Whoever
    # keeps a column of it keeps those buffers, and the next grasps have new ones.
    references = sys.getrefcount(columns), sys.getrefcount(phases)
    done = done_of(job, outcome, reason, body, _trace(table, numbers, images, times))
    if on_arrays and (sys.getrefcount(columns), sys.getrefcount(phases)) != references:
        storage.buffers = buffers._replace(columns=np.empty_like(columns), phases=np.empty_like(phases))
    return done


def _run(
    job: Job, setting: Setting, loop: Callable[..., Any], storage: Storage, on_arrays: bool
) -> tuple[Progress, Buffers]:
    """Run the loop to the end of the grasp, with longer buffers where those of the storage do not suffice."""
    blocks, ideal = setting.noise(), setting.sensor.ideal == 1
    buffers = storage.buffers
    if not ideal:
        _draw(buffers.pads.noise, blocks, 0)
    buffers.pads.images[-1] = math.nan
    zeros = np.full((2, CELLS), CELL_OFFSET[0])
    buffers = buffers._replace(pads=buffers.pads._replace(left_zero=zeros[0], right_zero=zeros[1]))
    if not on_arrays:
        # The interpreter indexes lists faster than arrays.
        buffers = as_lists(buffers)
    exact = discretise(job.config, setting, on_arrays=on_arrays)
    params = GraspParams(
        plant=setting.plant if exact is None else exact[0],
        sensor=setting.sensor,
        controller=job.params,
        dt_s=setting.dt_s,
        max_ticks=math.ceil(seconds_at_most(job.run) / setting.dt_s),
    )
    progress = Progress(NOT_STARTED, setting.body, setting.sensed, job.begins)
    while True:
        progress = loop(params, progress, buffers)
        if has_ended(progress.controller) or progress.loop.ticks >= params.max_ticks:
            return progress, buffers
        buffers = _doubled(buffers)
        if not ideal:
            _draw(buffers.pads.noise, blocks, len(buffers.pads.noise) // 2)
        if not on_arrays:
            buffers = as_lists(buffers)


def done_of(job: Job, outcome: Outcome, reason: str, body: PlantState, trace: Trace | None) -> Done:
    """Return what is kept of a grasp. A trace is needed if it is to be kept or extracted from."""
    extracted = None if job.extract is None or trace is None else job.extract(trace)
    return Done(
        outcome=outcome, reason=reason, body=body, extracted=extracted, kept=trace if job.traces else None
    )


def grasp_compiled(job: Job, setting: Setting, loop: Callable[..., Any], storage: Storage) -> Done:
    """Grasp by the compiled loop of its `composition_of`."""
    return grasp_once(job, as_compiled(setting), loop, storage, on_arrays=True, own=setting)


def chooser_of(job: Job, loops: Loops | None = None) -> Chooser:
    """Return what chooses the models of this job, checked by trial grasps under its controller."""
    return Checking(Control(job.controller, job.run), loops)


def plainly(job: Job, scene: str, seed: int) -> Done:
    """Grasp this scene with this seed in the interpreter."""
    setting = set_scene(job.config, scene, seed, chooser_of(job))
    loop = loop_of(_composed(job.config, setting, setting.kinds), type(job.controller).step)
    return grasp_once(job, setting, loop, Storage(), on_arrays=False)


def _draw(noise: Any, blocks: Iterator[Any], begin: int) -> int:
    """Fill `noise` from row `begin` on with whole blocks; return how many rows are filled."""
    while begin < len(noise):
        block = next(blocks)
        noise[begin : begin + len(block)] = block
        begin += len(block)
    return begin


def as_lists(buffers: Buffers) -> Buffers:
    """Return the same buffers as lists."""
    pads = PadBuffers(*(array.tolist() for array in buffers.pads))
    return Buffers(pads, *(array.tolist() for array in buffers[1:]))


def _doubled(buffers: Buffers) -> Buffers:
    """Return arrays of twice the length that begin with the same values."""

    def doubled(values: Any, axis: int = 0) -> Any:
        array = np.asarray(values)
        return np.concatenate([array, np.zeros_like(array)], axis=axis)

    pads = buffers.pads
    images = doubled(pads.images)
    images[-1] = math.nan
    zeros = np.asarray(pads.left_zero), np.asarray(pads.right_zero)
    return Buffers(
        pads=PadBuffers(*zeros, doubled(pads.noise), images),
        image_times=doubled(buffers.image_times),
        columns=doubled(buffers.columns, axis=1),
        phases=doubled(buffers.phases),
    )


def _trace(table: Any, phases: Any, cells: Any, times: Any) -> Trace:
    # The runner keeps the image that was there when the approach began, and those after it.
    begin = 0
    if len(phases) and len(times):
        begin = max(int(np.searchsorted(times, table[0, 0], side="right")) - 1, 0)
    cells = np.asarray(cells).reshape(-1, 2, CELLS)
    return Trace(
        **dict(zip(COLUMNS, table, strict=True)),
        status=np.zeros(len(phases), np.int64),
        phase=phases,
        pad_t_s=np.array(times[begin:]),
        pad_left=cells[begin:, 0].copy(),
        pad_right=cells[begin:, 1].copy(),
    )
