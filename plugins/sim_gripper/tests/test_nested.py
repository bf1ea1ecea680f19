"""Nested tuples, and the arrays of their numbers."""

from array import array
from typing import NamedTuple

import numpy as np
import pytest

from graspsense_sim_gripper.run.nested import (
    TupleType,
    append,
    count_numbers,
    first_place,
    structure,
    with_places,
)


class Inner(NamedTuple):
    steps: int
    force_n: float


class Outer(NamedTuple):
    inner: Inner
    halves: tuple[Inner, ...]
    nothing: tuple[()]
    broken: bool


VALUES = Outer(Inner(3, 0.1), (Inner(-1, float("inf")),), (), True)
PATTERN = Outer(Inner(0, 0.0), (Inner(0, 0.0),), (), False)


def numbers_of(values):
    numbers = []
    append(values, numbers, [])
    return array("d", numbers)


def test_tuples_come_back_with_their_types():
    values = TupleType.made_of(PATTERN).filled(numbers_of(VALUES))
    assert values == VALUES
    assert [type(value) for value in (values, values.halves[0], values.inner.steps, values.broken)] == [
        Outer,
        Inner,
        int,
        bool,
    ]


def test_a_number_by_itself_comes_back():
    assert TupleType.made_of(1).filled(numbers_of(7)) == 7


@pytest.mark.parametrize("count", [3, 7])
def test_another_number_of_numbers_is_refused(count):
    with pytest.raises(ValueError, match=f"{count} numbers for nested tuples of 5"):
        TupleType.made_of(PATTERN).filled([0.0] * count)


def test_places_count_the_numbers_and_leave_out_arrays():
    weights = np.zeros(3)
    values = (Inner(3, 0.1), (weights, 2.0), Outer(Inner(0, 0.0), (), (), False))
    numbers, arrays = [], []
    append(values, numbers, arrays)
    places = with_places(values)

    assert numbers == [3, 0.1, 2.0, 0, 0.0, False]
    assert [array is weights for array in arrays] == [True]
    assert (places[0], places[1][1], places[2].inner, places[2].broken) == (Inner(0, 1), 2, Inner(3, 4), 5)
    assert places[1][0] is weights
    assert count_numbers(values) == 6
    assert [first_place(places[2]), first_place(places[2].nothing)] == [3, 0]


def test_the_structure_tells_types_and_not_values():
    values, other = (Outer(Inner(k, 0.1 * k), (), (), True) for k in (1, 2))
    assert structure(values) == structure(other)
    assert structure(values) != structure(values._replace(nothing=(1.0,)))
    assert structure(values) != structure(values._replace(inner=Inner(1.0, 0.1)))
    assert structure((np.zeros(2),)) == structure((np.zeros(3),)) != structure((np.zeros(3, int),))
