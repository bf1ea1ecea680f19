"""The random numbers of a grasp: those of numpy's PCG64 with its seed, whoever draws them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Generator(Protocol):
    """A generator of random numbers that begins with a seed.

    In the same order of calls, all implementations give the same numbers as `numpy.random.default_rng(seed)`.
    """

    def standard_normal(self, shape: int | tuple[int, ...]) -> Array:
        """Return standard normal numbers."""

    def fill(self, table: Array) -> None:
        """Fill a contiguous table, row by row, with standard normal numbers."""

    def random(self) -> float:
        """Return a number from the uniform distribution between 0 and 1."""

    def copy(self) -> Generator:
        """Return another generator that continues with the same numbers."""


GeneratorOf = Callable[[int], Generator]
"""`generator_of(seed)` returns the generator that begins with this seed. Raises ValueError for a negative seed."""


class NumpyGenerator:
    """The generator of numpy itself."""

    def __init__(self, seed: int) -> None:
        """Begin with this seed."""
        # The same as `default_rng(seed)` in two thirds of its time.
        self._begin(np.random.PCG64(seed))

    def _begin(self, bits: np.random.PCG64) -> None:
        rng = np.random.Generator(bits)
        self._bits = bits
        self.standard_normal: Any = rng.standard_normal
        self.random: Any = rng.random

    def fill(self, table: Array) -> None:
        """Fill a contiguous table, row by row, with standard normal numbers."""
        self.standard_normal(out=table)

    def copy(self) -> NumpyGenerator:
        """Return another generator that continues with the same numbers."""
        bits = np.random.PCG64(0)
        bits.state = self._bits.state
        other = NumpyGenerator.__new__(NumpyGenerator)
        other._begin(bits)
        return other
