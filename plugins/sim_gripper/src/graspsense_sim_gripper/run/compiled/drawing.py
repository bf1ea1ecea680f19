"""Drawing what a seed decides of a grasp in compiled code: the instance, its placement, friction and the cells.

The rules are those of `objects.instance`, `dynamics.drive` and `fingertip`, in the order in which `build.instantiate`
draws: `test_a_drawn_grasp_is_that_of_the_seed` holds both equal to the bit. A scene gives the numbers of one of its
grasps, and where those are that a seed decides; these are overwritten.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import CompileOptions, entry_point
from graspsense_sim_gripper.plant.drive import FrictionSpread, drawn_friction
from graspsense_sim_gripper.plant.fingertip import CELLS, cell_offset
from graspsense_sim_gripper.run.compiled.generator import (
    WORD,
    CompiledGenerator,
    Draws,
    Words,
    compiled_draw,
    draw_normals,
    draw_uniform,
    draws_like_numpy,
    seed_state,
)
from graspsense_sim_gripper.run.compiled.jit import generating
from graspsense_sim_gripper.run.compiled.loop_code import CellNoise
from graspsense_sim_gripper.run.compiled.ziggurat import Ziggurat
from graspsense_sim_gripper.scene.instance import (
    N_COMMON_DRAWS,
    PAD_CELLS,
    cell_weights,
    draw_params,
    placed,
    take_number,
)
from graspsense_sim_gripper.scene.spec import InstanceSpread, NominalParams


class Places(NamedTuple):
    """Where the numbers that a seed decides are among those of a grasp."""

    coulomb_n: int
    breakaway_n: int
    width_m: int
    offset_m: int
    share: int
    image_phase_s: int
    params: NDArray[np.int64]
    """Those of the terms, in the order of `NominalParams`."""


class SceneNumbers(NamedTuple):
    """What the grasps of a scene are drawn from."""

    varies: int
    """1: instances and friction differ between seeds (`SimConfig.spread`)."""
    has_cells: int
    """1: the sensors are pads."""
    nominal: NominalParams
    spread: InstanceSpread
    n_own: int
    """Number of parameters with a spread of their own."""
    friction: FrictionSpread
    patch: int
    """As for `cell_weights`."""
    present: NDArray[np.float64]
    """(15,) As of `present_cells`."""


class CellArrays(NamedTuple):
    """The cells of a grasp: the weights of both fingertips, which are the same, and the offsets of each."""

    weights: NDArray[np.float64]
    left: NDArray[np.float64]
    right: NDArray[np.float64]


class DrawBuffers(NamedTuple):
    """The memory that drawing writes to, besides the numbers of the grasp."""

    pool: Words
    """Four words that seeding overwrites."""
    words: Words
    """The state of the generator: after a grasp was drawn, the noise of its cells follows."""
    draws: NDArray[np.float64]
    params: NDArray[np.float64]
    cells: CellArrays


NO_NUMBER: Final = np.zeros(0)
"""The draws of an object without a number."""


def draw_grasp(
    scene: SceneNumbers,
    places: Places,
    tables: Ziggurat,
    seed: Any,
    of_number: Any,
    buffers: DrawBuffers,
    numbers: Any,
) -> None:
    """Write what this seed decides to the numbers of a grasp of the scene, and to `buffers`.

    `of_number`: the draws of a numbered object (`draws_of_number`), or none.
    """
    pool, words, draws, params, cells = buffers
    seed_state(seed, pool, words)
    n_instance = (N_COMMON_DRAWS + scene.n_own) * scene.varies
    n_draws = n_instance + scene.varies + 2 * CELLS * scene.has_cells
    draw_normals(words, tables, draws[:n_draws])
    friction_draw, offset_draws = draws[n_instance], draws[n_draws - 2 * CELLS : n_draws]
    patch_row = 0.0
    if scene.varies == 1:
        coulomb_n, breakaway_n = drawn_friction(scene.friction, friction_draw)
        numbers[places.coulomb_n], numbers[places.breakaway_n] = coulomb_n, breakaway_n
        if len(of_number) > 0:
            take_number(draws, of_number)
        patch_row = _write_instance(scene, places, draws, params, numbers)
    if scene.has_cells == 1:
        for i in range(CELLS):
            cells.left[i], cells.right[i] = cell_offset(offset_draws[i]), cell_offset(offset_draws[CELLS + i])
        cell_weights(scene.patch, patch_row, cells.weights)
        for i in range(PAD_CELLS):
            cells.weights[i] *= scene.present[i]
        numbers[places.image_phase_s] *= draw_uniform(words)


def _write_instance(scene: SceneNumbers, places: Places, draws: Any, params: Any, numbers: Any) -> float:
    """Write the parameters and the placement of an instance to `numbers`; return its `Placement.patch_row`."""
    draw_params(scene.nominal, scene.spread.stiffness, draws, params)
    for i in range(len(places.params)):
        numbers[places.params[i]] = params[i]
    placement = placed(scene.spread, draws)
    numbers[places.width_m], numbers[places.offset_m] = placement.width_m, placement.offset_m
    if scene.has_cells == 1:
        numbers[places.share] = placement.share
    return placement.patch_row


def draw_buffers(n_draws: int, n_params: int) -> DrawBuffers:
    """Return the memory for a grasp with this many draws, besides those of the cells, and parameters."""
    cells = CellArrays(np.zeros(PAD_CELLS), np.zeros(CELLS), np.zeros(CELLS))
    return DrawBuffers(
        np.zeros(4, WORD), np.zeros(4, WORD), np.zeros(n_draws + 2 * CELLS), np.zeros(n_params), cells
    )


@frozen(eq=False)
class Drawing:
    """Draws grasps in compiled code."""

    draws: Draws
    _compiled: Callable[..., None]

    def __call__(
        self, scene: SceneNumbers, places: Places, seed: int, of_number: Any, buffers: DrawBuffers, to: Any
    ) -> None:
        """Draw a grasp as `draw_grasp` does, with a seed from 0 to LARGEST_SEED."""
        self._compiled(scene, places, self.draws.tables, WORD(seed), of_number, buffers, to)

    def noise(self, buffers: DrawBuffers) -> CompiledGenerator:
        """Return the generator of the noise of the cells in the grasp that was drawn last to these buffers."""
        return CompiledGenerator.in_state(buffers.words, self.draws)

    def noise_of(self, scene: SceneNumbers, buffers: DrawBuffers) -> CellNoise:
        """Return the same noise in the form that a compiled loop takes; nothing is drawn with ideal sensors."""
        return CellNoise(scene.has_cells, buffers.words, self.draws.tables)


@cache
def compiled_drawing() -> Drawing | None:
    """Return what draws grasps; None if the installed numpy draws other numbers. Raises NotCompilable."""
    draws = draws_like_numpy()
    if draws is None:
        return None
    none, no_places = np.zeros(0), np.zeros(0, np.int64)
    scene = SceneNumbers(
        *(0, 0, NominalParams(none, no_places, none), InstanceSpread(*(0.0,) * 7), 0),
        *(FrictionSpread(0.0, 0.0, 0.0), 0, np.zeros(PAD_CELLS)),
    )
    # It takes less time than getting the lock of the interpreter back from another thread.
    compiled = compiled_draw(draw_grasp, CompileOptions(releases_lock=False))
    with generating():
        compiled(
            scene, Places(0, 0, 0, 0, 0, 0, no_places), draws.tables, WORD(0), none, draw_buffers(6, 0), none
        )
    return Drawing(draws, entry_point(compiled))
