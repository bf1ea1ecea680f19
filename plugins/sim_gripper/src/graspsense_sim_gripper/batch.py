"""Many grasps at once: the compiled loop on all cores where numba is there, the plain one where it is not."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from typing import Any, Final

import numpy as np
from attrs import frozen

from graspsense.plugin_api import (
    CELLS,
    Controller,
    Outcome,
    RunConfig,
    Trace,
    first_state,
    tick_params,
)
from graspsense_sim_gripper import kernel
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant import PlantState
from graspsense_sim_gripper.setting import CELL_OFFSET, Setting, device_info, set_scene
from graspsense_sim_gripper.terms.registry import laws_of

WORTH_COMPILING: Final = 50
"""Grasps of one composition from which compiling it (1 to 2 s) takes less time than it saves."""
TICKS: Final = 12_000
IMAGES: Final = 256
"""Room for a grasp of 10 s; one that needs more is done again with twice that."""

_MEMO: dict[str, Any] = {}


@frozen(kw_only=True, eq=False)
class Done:
    """One grasp of many: its trace, how it ended, and the plant at the end (the true peak force is in it)."""

    trace: Trace
    outcome: Outcome
    body: PlantState


def run_many(
    config: SimConfig,
    controller: Controller[Any],
    scenes: Sequence[str],
    seeds: Sequence[int],
    *,
    compiled: bool | None = None,
) -> list[Done]:
    """Grasp each scene with its seed and return what came of each in that order, the same for any number of cores.

    `compiled` asks for compiling or forbids it; by default a composition is compiled from `WORTH_COMPILING`
    grasps on. Where a controller or a term cannot be compiled the plain loop runs, and a warning says why.
    """
    if len(scenes) != len(seeds):
        raise ValueError(f"{len(scenes)} scenes and {len(seeds)} seeds: give one seed a scene")
    step = type(controller).step
    run = RunConfig()
    law_params, law_state = tick_params(device_info(config), controller, run), first_state(controller.init())

    groups: dict[tuple[str, ...], list[int]] = {}
    settings: list[Setting] = []
    for i, (scene, seed) in enumerate(zip(scenes, seeds, strict=True)):
        setting = set_scene(config, scene, seed)
        settings.append(setting)
        groups.setdefault(setting.kinds, []).append(i)

    done: list[Done | None] = [None] * len(scenes)
    for kinds, members in groups.items():
        plain = kernel.grasp_of(laws_of(kinds), step)

        def one(i: int, loop: Callable[..., Any], on_arrays: bool) -> None:
            done[i] = _grasp(loop, on_arrays, settings[i], law_params, law_state)

        if compiled or (compiled is None and len(members) >= WORTH_COMPILING):
            try:
                fast = kernel.compiled(plain, _MEMO)
                # The first call compiles; the others then run beside each other without the interpreter's lock.
                with kernel.refusals():
                    one(members[0], fast, True)
            except kernel.NotCompilable as error:
                warnings.warn(
                    f"these grasps run in plain Python, about a hundred times slower: {error}", stacklevel=2
                )
            else:
                with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
                    list(pool.map(one, members[1:], repeat(fast), repeat(True)))
                continue
        for i in members:
            one(i, plain, False)
    return [one for one in done if one is not None]


def _grasp(
    loop: Callable[..., Any], on_arrays: bool, setting: Setting, law_params: Any, law_state: Any
) -> Done:
    room, blocks, noise = 1, setting.noise(), np.zeros((0, 2 * CELLS))
    while True:
        ticks, images = TICKS * room, IMAGES * room
        while len(noise) < images:
            noise = np.concatenate([noise, next(blocks)])
        cells = np.full((images, 2, CELLS), np.nan)
        times, columns = np.zeros(images), np.zeros((ticks, len(COLUMNS)))
        zeros = np.full((2, CELLS), CELL_OFFSET[0])
        storage: tuple[Any, ...] = (zeros[0], zeros[1], noise, cells, times, columns)
        if not on_arrays:
            # Lists are what plain Python indexes quickly.
            storage = tuple(part.tolist() for part in storage)
        recorded, body, sensor, state = loop(
            setting.plant,
            setting.sensor,
            setting.dt_s,
            law_params,
            setting.body,
            setting.sensed,
            law_state,
            *storage,
        )
        if state.done == 1 or state.guard.stopped == 1:
            break
        room *= 2
    _, _, _, cells, times, columns = (np.asarray(part) for part in storage)
    trace = _trace(columns[:recorded], cells[: sensor.images], times[: sensor.images])
    return Done(trace=trace, outcome=Outcome(state.law.outcome), body=body)


COLUMNS: Final = (
    "t_s",
    "gap_m",
    "velocity_m_s",
    "effort_n",
    "force_left_n",
    "force_right_n",
    "edge_left_n",
    "edge_right_n",
    "status",
    "phase",
    "command",
)


def _trace(columns: Any, cells: Any, times: Any) -> Trace:
    parts: dict[str, Any] = {name: np.ascontiguousarray(columns[:, k]) for k, name in enumerate(COLUMNS)}
    for name in ("status", "phase"):
        parts[name] = parts[name].astype(np.int64)
    # The runner keeps the image that was there when the approach began, and those after it.
    begin = int(np.searchsorted(times, parts["t_s"][0], side="right")) - 1 if len(columns) else 0
    begin = max(begin, 0)
    return Trace(
        **parts,
        pad_t_s=times[begin:].copy(),
        pad_left=cells[begin:, 0].copy(),
        pad_right=cells[begin:, 1].copy(),
    )
