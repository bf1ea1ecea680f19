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
from graspsense_sim_gripper.kernel import COLUMNS, NOT_BEGUN, grasp_of
from graspsense_sim_gripper.linear_modes import Shape
from graspsense_sim_gripper.linear_scene import linear_of
from graspsense_sim_gripper.plant import PlantState
from graspsense_sim_gripper.setting import CELL_OFFSET, Chooser, Setting, device_info, set_scene
from graspsense_sim_gripper.terms.registry import laws_of

TICKS: Final = 8200
"""Room for ticks; a grasp that needs more is given more on the way. Columns a power of two apart would all fall into
one set of a processor's cache, and drive each other out of it."""
IMAGES: Final = 128


@frozen(kw_only=True, eq=False)
class Done:
    """One grasp of many: how it ended, and the plant at the end (the true peak force is in it).

    `drawn` is what `Job.draw` made of its trace; the trace itself is there where it was asked for.
    """

    outcome: Outcome
    reason: str
    body: PlantState
    drawn: Any
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
    draw: Callable[[Trace], Any] | None
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


@define(eq=False)
class Storage:
    """What the compiled loop writes into, used again by one grasp after the other."""

    noise: Any = field(factory=lambda: np.zeros((IMAGES, 2 * CELLS)))
    cells: Any = field(factory=lambda: np.full((IMAGES, 2, CELLS), np.nan))
    times: Any = field(factory=lambda: np.zeros(IMAGES))
    columns: Any = field(factory=lambda: np.zeros((len(COLUMNS), TICKS)))
    phases: Any = field(factory=lambda: np.zeros(TICKS, np.int64))


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
    found = linear_of(config, setting, on_arrays=True)
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
    most = math.ceil(seconds_at_most(job.run) / setting.dt_s)
    body, sensor, state, stands = setting.body, setting.sensed, job.begins, NOT_BEGUN
    blocks, ideal = setting.noise(), setting.sensor.ideal == 1
    if not ideal:
        _draw(storage.noise, blocks, 0)
    zeros = np.full((2, CELLS), CELL_OFFSET[0])
    storage.cells[-1] = math.nan
    parts: tuple[Any, ...] = (
        *zeros,
        storage.noise,
        storage.cells,
        storage.times,
        storage.columns,
        storage.phases,
    )
    if not on_arrays:
        # Lists are what plain Python indexes quickly.
        parts = tuple(part.tolist() for part in parts)
    found = linear_of(job.config, setting, on_arrays=on_arrays)
    plant = setting.plant if found is None else found[0]
    while True:
        stands, body, sensor, state = loop(
            plant, setting.sensor, setting.dt_s, job.params, most, stands, body, sensor, state, *parts
        )
        if state.done == 1 or state.guard.stopped == 1 or stands.ticks >= most:
            break
        parts = _more_room(parts, blocks, on_arrays, ideal)
    _, _, noise, cells, times, columns, phases = parts
    if on_arrays:
        storage.noise, storage.cells, storage.times = noise, cells, times
        storage.columns, storage.phases = columns, phases
    if own is not None:
        body = as_own(body, own)
    outcome, reason = ended_by_itself(state)
    if state.done == 0 and state.guard.stopped == 0:
        outcome, reason = Outcome.ABORTED, overdue(job.run)
    if not job.traces and job.draw is None:
        return done_of(job, outcome, reason, body, None)
    n = stands.recorded
    table, numbers = np.asarray(columns)[:, :n], np.asarray(phases)[:n]
    cells, times = cells[: sensor.images], times[: sensor.images]
    if job.traces and 2 * n < len(columns[0]):
        return done_of(job, outcome, reason, body, _trace(table.copy(), numbers.copy(), cells, times))
    # What fills most of the storage, or is only drawn from, is not copied: what keeps some of it keeps the storage.
    held = sys.getrefcount(columns), sys.getrefcount(phases)
    done = done_of(job, outcome, reason, body, _trace(table, numbers, cells, times))
    if (sys.getrefcount(columns), sys.getrefcount(phases)) != held:
        storage.columns, storage.phases = np.empty_like(storage.columns), np.empty_like(storage.phases)
    return done


def done_of(job: Job, outcome: Outcome, reason: str, body: PlantState, trace: Trace | None) -> Done:
    """Return what is kept of a grasp. A trace is needed where one is to be kept or drawn from."""
    drawn = None if job.draw is None or trace is None else job.draw(trace)
    return Done(outcome=outcome, reason=reason, body=body, drawn=drawn, kept=trace if job.traces else None)


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


def _more_room(
    parts: tuple[Any, ...], blocks: Iterator[Any], on_arrays: bool, ideal: bool
) -> tuple[Any, ...]:
    """Return the storage of a grasp under way, twice as large and beginning alike, with the noise for it."""
    left_zero, right_zero, noise, cells, times, columns, phases = (np.asarray(part) for part in parts)
    had = len(noise)
    noise, cells, times, phases = (_doubled(part) for part in (noise, cells, times, phases))
    columns = np.concatenate([columns, np.zeros_like(columns)], axis=1)
    cells[-1] = math.nan
    if not ideal:
        _draw(noise, blocks, had)
    more = (left_zero, right_zero, noise, cells, times, columns, phases)
    return more if on_arrays else tuple(part.tolist() for part in more)


def _doubled(part: Any) -> Any:
    return np.concatenate([part, np.zeros_like(part)])


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
