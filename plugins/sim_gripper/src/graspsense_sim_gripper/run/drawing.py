"""Drawing what a seed decides of a grasp: the instance, its placement, friction and the cells.

`build.instantiate` draws in the interpreter, and a batch in compiled code, with the same functions.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.drive import FrictionSpread, drawn_friction
from graspsense_sim_gripper.plant.fingertip import CELLS, cell_offset
from graspsense_sim_gripper.scene.instance import (
    FACE,
    N_COMMON_DRAWS,
    PAD_CELLS,
    Placement,
    cell_weights,
    draw_params,
    placed,
    present_cells,
    take_number,
)
from graspsense_sim_gripper.scene.random_numbers import (
    GRASP,
    NOISE,
    Word,
    draw_normals,
    draw_units,
    make_normal,
)
from graspsense_sim_gripper.scene.spec import PATCHES, InstanceSpread, NominalParams, ObjectSpec

NOISE_NUMBERS: Final = 2 * CELLS
"""Standard normal numbers of the noise of a cell image: whole blocks of the generator."""
FRICTION, PHASE, OFFSETS, INSTANCE = 0, 1, 2, 2 + 2 * CELLS
"""The places of the draws of a grasp; those of the instance are last, since their number differs."""
NO_NUMBER: Final = np.zeros(0)
"""The draws of an object without a number."""
NO_OBJECT: Final = (
    NominalParams((), (), ()),
    InstanceSpread(
        stiffness=0.0,
        width_m=-1.0,
        width_spread_m=0.0,
        offset_m=0.0,
        offset_spread_m=0.0,
        share=1.0,
        share_spread=0.0,
    ),
)
"""No terms, and a negative width: the fingers close without touching anything."""


class SceneNumbers(NamedTuple):
    """What the grasps of a scene are drawn from."""

    varies: int
    """1: instances and friction differ between seeds (`SimConfig.spread`)."""
    nominal: NominalParams
    spread: InstanceSpread
    n_own: int
    """Number of parameters with a spread of their own."""
    friction: FrictionSpread
    patch: int
    """As for `cell_weights`."""
    present: NDArray[np.float64]
    """(15,) As of `present_cells`."""
    period_s: float
    """Between two cell images; 0: the sensors are ideal and have no cells."""


class CellArrays(NamedTuple):
    """The cells of a grasp: the weights of both fingertips, which are the same, and the offsets of each."""

    weights: NDArray[np.float64]
    left: NDArray[np.float64]
    right: NDArray[np.float64]


class DrawBuffers(NamedTuple):
    """What drawing writes to."""

    draws: Any
    params: Any
    """Those of the terms, in the order of `NominalParams`."""
    cells: CellArrays


class Drawn(NamedTuple):
    """What was drawn of a grasp, besides what is in `DrawBuffers`."""

    coulomb_n: float
    breakaway_n: float
    placement: Placement
    image_phase_s: float


def scene_numbers(config: SimConfig, spec: ObjectSpec | None) -> SceneNumbers:
    """Return what the grasps of an object are drawn from; None: there is no object."""
    nominal, spread = NO_OBJECT if spec is None else (spec.nominal_params, spec.spread)
    return SceneNumbers(
        varies=1 if config.spread else 0,
        nominal=nominal,
        spread=spread,
        n_own=0 if spec is None else spec.n_own_spreads,
        friction=FrictionSpread(
            float(config.coulomb_n), float(config.coulomb_spread_n), float(config.breakaway_n)
        ),
        patch=FACE if spec is None else PATCHES.index(spec.patch),
        present=present_cells(config.pad_cells),
        period_s=0.0 if config.sensor == "ideal" else float(config.pad_period_s),
    )


def draw_buffers(scene: SceneNumbers) -> DrawBuffers:
    """Return what the grasps of this scene are drawn to, as lists and arrays for the interpreter."""
    cells = CellArrays(np.zeros(PAD_CELLS), np.zeros(CELLS), np.zeros(CELLS))
    n_draws = INSTANCE + N_COMMON_DRAWS + scene.n_own
    return DrawBuffers([0.0] * n_draws, [0.0] * len(scene.nominal.value), cells)


def draw_grasp(scene: SceneNumbers, key: Word, of_number: Any, buffers: DrawBuffers) -> Drawn:
    """Draw a grasp of the scene, and write its parameters and cells to `buffers`.

    `of_number`: the draws of a numbered object (`draws_of_number`), or none.
    """
    draws, params, cells = buffers
    n_draws, phase_s = len(draws), 0.0
    if scene.varies == 1 or scene.period_s > 0.0:
        draw_units(key, GRASP, 0, n_draws, draws)
        phase_s = draws[PHASE] * scene.period_s
        make_normal(draws, n_draws)
    if scene.varies == 0:
        draws[FRICTION] = 0.0
        for i in range(INSTANCE, n_draws):
            draws[i] = 0.0
    own = draws[INSTANCE:]
    if scene.varies == 1 and len(of_number) > 0:
        take_number(own, of_number)
    draw_params(scene.nominal, scene.spread.stiffness, own, params)
    placement = placed(scene.spread, own)
    if scene.period_s > 0.0:
        for i in range(CELLS):
            cells.left[i], cells.right[i] = (
                cell_offset(draws[OFFSETS + i]),
                cell_offset(draws[OFFSETS + CELLS + i]),
            )
        cell_weights(scene.patch, placement.patch_row, cells.weights)
        for i in range(PAD_CELLS):
            cells.weights[i] *= scene.present[i]
    coulomb_n, breakaway_n = drawn_friction(scene.friction, draws[FRICTION])
    return Drawn(coulomb_n, breakaway_n, placement, phase_s)


def draw_image_noise(key: Word, begin: int, end: int, noise: Any) -> None:
    """Write the noise of the cells in the images `begin` to `end` - 1 of a grasp to these rows of `noise` (k, 44)."""
    numbers = noise[begin:end].reshape(-1)
    draw_units(key, NOISE, NOISE_NUMBERS * begin, len(numbers), numbers)
    for image in range(begin, end):
        make_normal(noise[image], NOISE_NUMBERS)


def image_noise(key: Word, begin: int, count: int) -> NDArray[np.float64]:
    """Return the noise (count, 44) of the cells in the images of a grasp from image `begin` on."""
    numbers = np.empty(count * NOISE_NUMBERS)
    draw_normals(key, NOISE, begin * NOISE_NUMBERS, len(numbers), numbers)
    return numbers.reshape(count, NOISE_NUMBERS)
