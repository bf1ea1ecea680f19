"""numpy's generator PCG64 with its standard normal numbers in compiled code: the same numbers in a third of the time.

A generator is seeded as by `numpy.random.SeedSequence`, which hashes the seed to four words of 32 bits (M. E. O'Neill,
"Developing a seed_seq alternative", 2015), and is the permuted congruential generator XSL RR 128/64 (M. E. O'Neill,
HMC-CS-2014-0905). Its state is four words of 64 bits: the upper and the lower half of a 128-bit number, and those of
its increment. `ziggurat` explains the normal numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense.plugin_api import CompileOptions, NotCompilable, compile_function, entry_point
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.compiled.jit import generating
from graspsense_sim_gripper.run.compiled.ziggurat import TAIL, Ziggurat, ziggurat_of_numpy
from graspsense_sim_gripper.scene.random_numbers import GeneratorOf, NumpyGenerator

WORD = np.uint64
Word = Any
"""An unsigned 64-bit number."""
Words = Any
"""The state of a generator: (4,) words."""

LOW_32: Final = WORD(0xFFFFFFFF)
MULTIPLIER_HIGH: Final = WORD(0x2360ED051FC65DA4)
MULTIPLIER_LOW: Final = WORD(0x4385DF649FCCF645)
TO_UNIT: Final = 2.0**-53
TAIL_START: Final = TAIL
ZERO, ONE, EIGHT, NINE, ELEVEN = WORD(0), WORD(1), WORD(8), WORD(9), WORD(11)
SIXTEEN, HALF, LAST_BIT, ROTATION = WORD(16), WORD(32), WORD(63), WORD(58)
LAYER_BITS, SIGNED_LAYER_BITS, PLACE_BITS = WORD(0xFF), WORD(0x1FF), WORD((1 << 52) - 1)
POOL_BEGIN, POOL_FACTOR = WORD(0x43B0D7E5), WORD(0x931E8875)
WORD_BEGIN, WORD_FACTOR = WORD(0x8B51F9DD), WORD(0x58F38DED)
MIX_LEFT, MIX_RIGHT = WORD(0xCA01F9DD), WORD(0x4973F715)
LARGEST_SEED: Final = (1 << 64) - 1
"""The largest seed that compiled code hashes."""
COMPARED: Final = 20_000
"""Number of draws that are compared with those of numpy before compiled code replaces it."""


def high_product(a: Word, b: Word) -> Word:
    """Raise TypeError: `compiled_generator` binds the product of compiled code."""
    raise TypeError("no product is bound: use compiled_generator")


def _hashed(value: Word, factor: Word, next_factor: Word) -> Word:
    """Return 32 bits of a hash of 32 bits."""
    value = ((value ^ factor) * next_factor) & LOW_32
    return value ^ (value >> SIXTEEN)


def _mixed(a: Word, b: Word) -> Word:
    """Return 32 bits of a mixture of two hashes."""
    value = (MIX_LEFT * a - MIX_RIGHT * b) & LOW_32
    return value ^ (value >> SIXTEEN)


def seed_state(seed: Word, pool: Words, state: Words) -> None:
    """Write the state of the generator with this seed; `pool` is overwritten too."""
    factor = POOL_BEGIN
    for i in range(4):
        word = seed & LOW_32 if i == 0 else (seed >> HALF if i == 1 else ZERO)
        next_factor = (factor * POOL_FACTOR) & LOW_32
        pool[i] = _hashed(word, factor, next_factor)
        factor = next_factor
    for source in range(4):
        for target in range(4):
            if source != target:
                next_factor = (factor * POOL_FACTOR) & LOW_32
                pool[target] = _mixed(pool[target], _hashed(pool[source], factor, next_factor))
                factor = next_factor
    factor = WORD_BEGIN
    for i in range(4):
        word = ZERO
        for k in range(2):
            next_factor = (factor * WORD_FACTOR) & LOW_32
            word |= _hashed(pool[(2 * i + k) % 4], factor, next_factor) << (HALF if k == 1 else ZERO)
            factor = next_factor
        state[i] = word
    begin_high, begin_low = state[0], state[1]
    increment_high, increment_low = (state[2] << ONE) | (state[3] >> LAST_BIT), (state[3] << ONE) | ONE
    low = increment_low + begin_low
    high = increment_high + begin_high + (ONE if low < begin_low else ZERO)
    _, high, low = _next_word(high, low, increment_high, increment_low)
    state[0], state[1], state[2], state[3] = high, low, increment_high, increment_low


def _next_word(high: Word, low: Word, increment_high: Word, increment_low: Word) -> tuple[Word, Word, Word]:
    """Return 64 random bits, and the upper and the lower half of the next state."""
    next_low = low * MULTIPLIER_LOW
    next_high = high_product(low, MULTIPLIER_LOW) + high * MULTIPLIER_LOW + low * MULTIPLIER_HIGH
    low = next_low + increment_low
    high = next_high + increment_high + (ONE if low < next_low else ZERO)
    turn, bits = high >> ROTATION, high ^ low
    return (bits >> turn) | (bits << ((-turn) & LAST_BIT)), high, low


def _unit(word: Word) -> float:
    """Return a number from the uniform distribution between 0 and 1."""
    return np.int64(word >> ELEVEN) * TO_UNIT


def draw_uniform(state: Words) -> float:
    """Return a number from the uniform distribution between 0 and 1."""
    word, state[0], state[1] = _next_word(state[0], state[1], state[2], state[3])
    return _unit(word)


def draw_normals(state: Words, tables: Ziggurat, numbers: Any) -> None:
    """Fill `numbers` (n,) with standard normal numbers."""
    factors, bounds, densities = tables
    high, low, increment_high, increment_low = state[0], state[1], state[2], state[3]
    i, n = 0, len(numbers)
    while i < n:
        word, high, low = _next_word(high, low, increment_high, increment_low)
        layer, place = np.int64(word & LAYER_BITS), (word >> NINE) & PLACE_BITS
        number = np.int64(place) * factors[np.int64(word & SIGNED_LAYER_BITS)]
        accepted = place < bounds[layer]
        if not accepted:
            if layer == 0:
                number, high, low = _from_tail(place, high, low, increment_high, increment_low)
                accepted = True
            else:
                word, high, low = _next_word(high, low, increment_high, increment_low)
                inner, outer = densities[layer - 1], densities[layer]
                accepted = (inner - outer) * _unit(word) + outer < math.exp(-0.5 * number * number)
        numbers[i] = number
        if accepted:
            i += 1
    state[0], state[1] = high, low


def _from_tail(
    place: Word, high: Word, low: Word, increment_high: Word, increment_low: Word
) -> tuple[float, Word, Word]:
    """Return a number beyond the last layer, and the next state. A bit of `place` gives its sign."""
    while True:
        word, high, low = _next_word(high, low, increment_high, increment_low)
        beyond = -(1.0 / TAIL_START) * math.log1p(-_unit(word))
        word, high, low = _next_word(high, low, increment_high, increment_low)
        height = -math.log1p(-_unit(word))
        if height + height > beyond * beyond:
            number = TAIL_START + beyond
            return (-number if (place >> EIGHT) & ONE == ONE else number), high, low


class Draws(NamedTuple):
    """The functions of a generator, compiled, and its tables."""

    seed: Callable[..., None]
    uniform: Callable[..., float]
    normals: Callable[..., None]
    tables: Ziggurat


class CompiledGenerator:
    """The generator with a seed, in compiled code."""

    __slots__ = ("_draws", "_state")

    def __init__(self, seed: int, draws: Draws) -> None:
        """Begin with this seed. Raises ValueError for a negative seed."""
        self._draws, self._state = draws, np.empty(4, WORD)
        if 0 <= seed <= LARGEST_SEED:
            # Memory of its own: other threads may seed theirs meanwhile.
            draws.seed(WORD(seed), np.empty(4, WORD), self._state)
        else:
            words = np.random.PCG64(seed).state["state"]
            halves = [words["state"] >> 64, words["state"], words["inc"] >> 64, words["inc"]]
            self._state[:] = [half & LARGEST_SEED for half in halves]

    def standard_normal(self, shape: int | tuple[int, ...]) -> NDArray[np.float64]:
        """Return standard normal numbers."""
        table = np.empty(shape)
        self.fill(table)
        return table

    def fill(self, table: NDArray[np.float64]) -> None:
        """Fill a contiguous table, row by row, with standard normal numbers."""
        self._draws.normals(self._state, self._draws.tables, table.reshape(-1))

    def random(self) -> float:
        """Return a number from the uniform distribution between 0 and 1."""
        return self._draws.uniform(self._state)

    def copy(self) -> CompiledGenerator:
        """Return another generator that continues with the same numbers."""
        return CompiledGenerator.in_state(self._state.copy(), self._draws)

    @classmethod
    def in_state(cls, state: Words, draws: Draws) -> CompiledGenerator:
        """Return the generator in this state, which it goes on to change."""
        generator = cls.__new__(cls)
        generator._draws, generator._state = draws, state
        return generator


def compiled_generator() -> GeneratorOf:
    """Return `CompiledGenerator`; `NumpyGenerator` if the installed numpy draws other numbers. Raises NotCompilable."""
    draws = draws_like_numpy()
    return NumpyGenerator if draws is None else lambda seed: CompiledGenerator(seed, draws)


@cache
def draws_like_numpy() -> Draws | None:
    """Return the functions of a generator, compiled; None if the installed numpy draws others. Raises NotCompilable."""
    draws = _draws()
    mine, numpy = CompiledGenerator(1, draws), NumpyGenerator(1)
    same = mine.random() == numpy.random()
    same = same and bool((mine.standard_normal(COMPARED) == numpy.standard_normal(COMPARED)).all())
    return draws if same else None


def _draws() -> Draws:
    tables, words = ziggurat_of_numpy(), np.zeros(4, WORD)
    seed, uniform, normals = (compiled_draw(draw) for draw in (seed_state, draw_uniform, draw_normals))
    with generating():
        seed(WORD(1), words, np.zeros(4, WORD))
        uniform(words)
        normals(words, tables, np.zeros(1))
    return Draws(entry_point(seed), entry_point(uniform), entry_point(normals), tables)


def compiled_draw(draw: Callable[..., Any], options: CompileOptions | None = None) -> Callable[..., Any]:
    """Return a function that calls those of this generator, compiled. Raises NotCompilable."""
    return compile_function(with_wide_product(draw), options)


def with_wide_product(draw: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that calls those of this generator, with the product that these need. Raises NotCompilable."""
    try:
        from graspsense_sim_gripper.run.compiled.wide_product import high_product
    except ImportError as error:
        raise NotCompilable(str(error)) from error
    return bind_reachable(draw, {"high_product": high_product})
