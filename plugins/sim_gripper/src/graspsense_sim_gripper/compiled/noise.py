"""Drawing the noise of the cell images by machine code: the numbers of numpy's generator in half of its time."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspsense.plugin_api import compile_function, entry_point
from graspsense_sim_gripper.compiled.jit import generating

DrawNoise = Callable[[np.random.Generator, NDArray[np.float64]], Any]
"""`draw(rng, table)` fills the table, row by row, with standard normal numbers of the generator."""


def draw_by_numpy(rng: np.random.Generator, table: NDArray[np.float64]) -> None:
    """Fill the table with standard normal numbers."""
    rng.standard_normal(out=table)


def draw_one_by_one(rng: Any, table: Any) -> None:
    """Fill the table with the same numbers as `draw_by_numpy`, in a form that can be compiled."""
    for row in range(table.shape[0]):
        for column in range(table.shape[1]):
            table[row, column] = rng.standard_normal()


@cache
def compiled_noise() -> DrawNoise:
    """Return `draw_one_by_one`, compiled. Raises NotCompilable."""
    draw = compile_function(draw_one_by_one)
    with generating():
        draw(np.random.Generator(np.random.PCG64(0)), np.zeros((1, 1)))
    return entry_point(draw)
