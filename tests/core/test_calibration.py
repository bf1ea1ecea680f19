"""From counts to newtons, and when a tare is refused."""

from math import nan

import pytest
from cases import every_case

from graspsense.core.grasp.calibration import edge_force, masked, pad_force, tare, zero_of
from graspsense.core.values.errors import TareRefused
from graspsense.core.values.signals import Pads
from graspsense.testing.model_gripper import CELLS

EDGE_COUNTS_PER_N = (600.0, 400.0, 600.0, 600.0, 600.0, 600.0, 400.0)


def image(counter, level=3300.0, pad=0.0):
    cells = tuple(level + (pad if i >= 7 else 0.0) for i in range(CELLS))
    return Pads(counter * 0.041, counter, cells, cells)


ZERO = (3000.0,) * CELLS


def test_a_newton_is_1600_counts_over_the_pads_fifteen_cells():
    cells = tuple(3000.0 + (1600.0 / 15 if i >= 7 else 5000.0) for i in range(CELLS))
    assert pad_force(cells, ZERO, 1600.0, 7) == pytest.approx(1.0)


def test_edge_force_is_the_largest_single_edge_cell_each_with_its_own_scale():
    cells = list(ZERO)
    cells[1] += 100.0  # a side cell, 400 counts/N
    cells[3] += 120.0  # a tip cell, 600 counts/N
    cells[10] += 9000.0  # a pad cell: no edge
    assert edge_force(cells, ZERO, EDGE_COUNTS_PER_N) == pytest.approx(0.25)


@every_case("place", [0, 10, CELLS - 1])
@every_case("reading", [0.0, 65535.0, nan])
def test_a_cell_that_does_not_answer_is_left_out_wherever_it_is(place, reading):
    cells = (3500.0,) * CELLS
    with_dead, masked_cells = ((*cells[:place], value, *cells[place + 1 :]) for value in (reading, 3000.0))
    assert masked(cells, ZERO) == (cells, 0)
    assert masked(with_dead, ZERO) == (masked_cells, 1)
    # One that was dead in the tare is dead afterwards.
    assert masked((3500.0,) * 3, (3000.0, 0.0, 3000.0)) == ((3500.0, 0.0, 3500.0), 1)


def test_the_zero_is_the_mean_of_all_images_not_the_last():
    zeros = tare([image(1, 3300.0), image(2, 3310.0), image(3, 3305.0)], 1600.0, 7)
    assert zeros[0] == pytest.approx((3305.0,) * CELLS)
    assert zero_of([(1.0, 2.0), (3.0, 6.0)]) == (2.0, 4.0)


@every_case(
    ("images", "says"),
    [
        ([], "no cell image"),
        ([image(1), image(2, pad=60.0), image(3)], r"left pad.* 0\.5 N"),
        ([image(1, nan), image(2)], "not numbers"),
    ],
)
def test_a_tare_is_refused_without_images_or_numbers_and_while_something_moves(images, says):
    with pytest.raises(TareRefused, match=says):
        tare(images, 1600.0, 7)
