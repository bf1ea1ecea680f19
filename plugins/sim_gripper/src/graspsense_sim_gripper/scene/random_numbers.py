"""The random numbers of a grasp: each follows from the seed, the stream and its place in the stream alone.

They are those of the counter-based generator Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2,
3", SC 2011). The seed is its key, and each block of four numbers has a counter of its own. Standard normal
numbers come from a table of quantiles, and in the tails from the algorithm AS 241 (Wichura, Applied Statistics 37,
1988).

`draw_units` and `make_normal` are written for arrays. Compiled code uses `draw_units_by_block` and `make_each_normal`,
which give the same bits (`IN_COMPILED_CODE`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from statistics import NormalDist
from typing import Any, Final

import numpy as np

Word = Any
"""An unsigned 64-bit number, or an array of these; in a counter and in a product it holds 32 bits."""

LOW, HALF, ZERO, ONE = np.uint64(0xFFFFFFFF), np.uint64(32), np.uint64(0), np.uint64(1)
FACTORS: Final = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
KEY_STEPS: Final = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
ROUNDS: Final = 10
BLOCK: Final = 4
"""Numbers of a block. A table is drawn from the beginning of a block on."""
TO_UNIT, MIDDLE = 2.0**-32, 2.0**-33
LARGEST_SEED: Final = (1 << 64) - 1
GRASP, NOISE, OBJECT = np.uint64(0), np.uint64(1), np.uint64(3)
"""Streams: what a grasp begins with, the noise of its cells, and a numbered object."""
INTERVALS: Final = 1024
QUANTILES: Final = np.array([0.0, *(NormalDist().inv_cdf(k / INTERVALS) for k in range(1, INTERVALS)), 0.0])
"""Those of the standard normal distribution. The first and the last interval are its tails."""
IN_TABLE: Final = 0.5 - 1.0 / INTERVALS
"""Distance from the median probability up to which the table is right."""


def key_of(seed: int) -> np.uint64:
    """Return the key of a seed. Raises ValueError for one that is negative or larger than `LARGEST_SEED`."""
    if not 0 <= seed <= LARGEST_SEED:
        raise ValueError(
            f"the seed {seed} is not between 0 and {LARGEST_SEED}: use non-negative seeds of 64 bits"
        )
    return np.uint64(seed)


def philox(c0: Word, c1: Word, c2: Word, c3: Word, k0: Word, k1: Word) -> tuple[Word, Word, Word, Word]:
    """Return the four random words of a counter and a key, all of 32 bits."""
    for _ in range(ROUNDS):
        left, right = FACTORS[0] * c0, FACTORS[1] * c2
        c0, c1, c2, c3 = (right >> HALF) ^ c1 ^ k0, right & LOW, (left >> HALF) ^ c3 ^ k1, left & LOW
        k0, k1 = (k0 + KEY_STEPS[0]) & LOW, (k1 + KEY_STEPS[1]) & LOW
    return c0, c1, c2, c3


def from_table(p: Any) -> Any:
    """Return the number below which the probability is `p`, away from the tails; also of arrays.

    It is exact at the quantiles of the table, and linear between them: the distribution function is right to 1e-4.
    """
    place = p * INTERVALS
    # Compiled code looks whether a signed index is negative.
    i = np.uint64(place)
    return QUANTILES[i] + (place - np.float64(i)) * (QUANTILES[i + ONE] - QUANTILES[i])


def tail(p: float) -> float:
    """Return the number below which the probability is `p`, in the tails, from 1e-11 on."""
    r = math.sqrt(-math.log(min(p, 1.0 - p))) - 1.6
    above = ((1.7023821103e-01 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777
    below = (1.2021132975e-01 * r + 7.3700164250e-01) * r + 1.0
    return math.copysign(above / below, p - 0.5)


def draw_units(key: Word, stream: Word, begin: int, count: int, numbers: Any) -> None:
    """Write `count` numbers from the uniform distribution between 0 and 1 to an array or a list.

    `begin`: the place of the first of them in the stream, a multiple of `BLOCK`.
    """
    blocks = np.arange(begin // BLOCK, (begin + count + BLOCK - 1) // BLOCK, dtype=np.uint64)
    words = philox(blocks & LOW, blocks >> HALF, stream, ZERO, key & LOW, key >> HALF)
    numbers[:count] = (np.stack(words, axis=-1).reshape(-1)[:count] * TO_UNIT + MIDDLE).tolist()


def make_normal(numbers: Any, count: int) -> None:
    """Turn the first numbers of an array or a list from `draw_units` into standard normal ones."""
    p = np.asarray(numbers[:count])
    made = from_table(p)
    for i in np.flatnonzero(np.abs(p - 0.5) >= IN_TABLE).tolist():
        made[i] = tail(float(p[i]))
    numbers[:count] = made.tolist()


def draw_units_by_block(key: Word, stream: Word, begin: int, count: int, numbers: Any) -> None:
    """Do what `draw_units` does, block by block; for compiled code, which computes several blocks at a time."""
    n_whole = count // BLOCK
    for block in range(n_whole):
        place = np.uint64(begin // BLOCK + block)
        w0, w1, w2, w3 = philox(place & LOW, place >> HALF, stream, ZERO, key & LOW, key >> HALF)
        numbers[BLOCK * block] = w0 * TO_UNIT + MIDDLE
        numbers[BLOCK * block + 1] = w1 * TO_UNIT + MIDDLE
        numbers[BLOCK * block + 2] = w2 * TO_UNIT + MIDDLE
        numbers[BLOCK * block + 3] = w3 * TO_UNIT + MIDDLE
    place = np.uint64(begin // BLOCK + n_whole)
    words = philox(place & LOW, place >> HALF, stream, ZERO, key & LOW, key >> HALF)
    for i in range(count - BLOCK * n_whole):
        numbers[BLOCK * n_whole + i] = words[i] * TO_UNIT + MIDDLE


def make_each_normal(numbers: Any, count: int) -> None:
    """Do what `make_normal` does; for compiled code, which computes several numbers at a time where none is a tail."""
    n_tails = 0
    for i in range(count):
        n_tails += abs(numbers[i] - 0.5) >= IN_TABLE
    if n_tails == 0:
        for i in range(count):
            numbers[i] = from_table(numbers[i])
    else:
        for i in range(count):
            p = numbers[i]
            numbers[i] = tail(p) if abs(p - 0.5) >= IN_TABLE else from_table(p)


IN_COMPILED_CODE: Final[Mapping[str, Callable[..., None]]] = {
    "draw_units": draw_units_by_block,
    "make_normal": make_each_normal,
}
"""What compiled code calls in place of the functions for arrays."""


def draw_normals(key: Word, stream: Word, begin: int, count: int, numbers: Any) -> None:
    """Write standard normal numbers, otherwise as `draw_units`."""
    draw_units(key, stream, begin, count, numbers)
    make_normal(numbers, count)
