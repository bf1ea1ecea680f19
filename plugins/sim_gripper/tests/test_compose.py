"""Composing functions: a part replaces the global of its name wherever that is reached, and nowhere else."""

from types import SimpleNamespace
from typing import NamedTuple

import pytest

from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.compiled.compose import Composition, composed_move, grasp_loop
from graspsense_sim_gripper.scene.terms.elastic import elastic


class Pair(NamedTuple):
    left: float
    right: float


def factor(x):
    raise TypeError("unbound")


def inner(x):
    return Pair(factor(x), x)


def outer(x):
    return inner(x), untouched(x)


def untouched(x):
    return x + 1.0


def twice(x):
    return 2.0 * x


def test_a_part_is_replaced_at_any_depth_and_the_original_stays():
    bound = bind_reachable(outer, {"factor": twice})
    assert bound(3.0) == (Pair(6.0, 3.0), 4.0)
    with pytest.raises(TypeError, match="unbound"):
        outer(3.0)
    assert bound.__globals__["untouched"] is untouched


def test_a_constructor_replaces_its_class_whatever_the_name():
    def as_namespace(left, right):
        return SimpleNamespace(left=left, right=right)

    bound = bind_reachable(outer, {"factor": twice}, {Pair: as_namespace})
    assert bound(3.0)[0] == SimpleNamespace(left=6.0, right=3.0)


def test_a_part_that_nothing_reads_is_refused():
    with pytest.raises(TypeError, match=r"nothing that outer calls names a part \['speed'\]"):
        bind_reachable(outer, {"factor": twice, "speed": twice})


def test_the_loop_of_a_composition_is_made_once_for_a_controller():
    composition = Composition(("elastic",), False)
    assert composed_move(composition) is composed_move(Composition(("elastic",), False))
    assert grasp_loop(composition, elastic) is grasp_loop(composition, elastic)
    assert grasp_loop(composition, elastic) is not grasp_loop(composition, twice)
