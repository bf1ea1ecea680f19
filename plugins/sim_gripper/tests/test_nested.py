"""Nested tuples that another process sends as the list of their numbers."""

from array import array
from typing import NamedTuple

import pytest

from graspsense_sim_gripper.nested import TupleType, append_numbers


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
    found = []
    append_numbers(found, values)
    return array("d", found)


def test_tuples_come_back_with_their_types():
    found = TupleType.of(PATTERN).filled(numbers_of(VALUES))
    assert found == VALUES
    assert [type(value) for value in (found, found.halves[0], found.inner.steps, found.broken)] == [
        Outer,
        Inner,
        int,
        bool,
    ]


def test_a_number_by_itself_comes_back():
    assert TupleType.of(1).filled(numbers_of(7)) == 7


@pytest.mark.parametrize("count", [3, 7])
def test_another_number_of_numbers_is_refused(count):
    with pytest.raises(ValueError, match=f"{count} numbers for nested tuples of 5"):
        TupleType.of(PATTERN).filled([0.0] * count)
