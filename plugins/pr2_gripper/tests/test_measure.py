"""From counts to metres and newtons, with values that follow from the published figures."""

import math

import pytest
from cases import every_case

from graspsense.gripper_api import LoadTable, TareRefused, revolutions_at
from graspsense.plugin_api import Pads
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.linkage import LINKAGES
from graspsense_pr2_gripper.measure import Measure
from graspsense_pr2_gripper.protocol import InputReport
from graspsense_pr2_gripper.status import BAD_CELL, BEYOND_TABLE
from graspsense_pr2_gripper.stream import RawImage

TIP = tuple(3000.0 + i for i in range(22))


def report(ticks=0, velocity_mtick_s=0, status=0, time_us=0):
    return InputReport(0, time_us, ticks, velocity_mtick_s, 0, status, 0, (), 1, 0, (0, 0, 0, 0), 0, 0)


def image(counter, left=None, right=None):
    """An image with these counts over the zero of `TIP` on these cells."""
    cells = [int(TIP[i]) + over.get(i, 0) for over in (left or {}, right or {}) for i in range(22)]
    return RawImage(counter, 1000 * counter, tuple(map(float, cells)))


def tared(identity, config=None, tables=None):
    measure = Measure(identity, config or Pr2Config(), None, tables)
    measure.tare([Pads(0.041 * i, i, TIP, TIP) for i in range(1, 7)])
    return measure


def test_velocity_is_the_motors_times_the_linkages_ratio(device_identity):
    """pr2 linkage at 50 mm: 0.3975 mm a revolution; one revolution a second is 1200 ticks."""
    measure = Measure(device_identity(), Pr2Config(), None, None)
    ticks = round(revolutions_at(LINKAGES["pr2"], 0.050) * 1200)
    frame = measure.reading(report(ticks, velocity_mtick_s=-1_200_000), None).frame
    assert frame.velocity_m_s == pytest.approx(-0.3975e-3, rel=2e-4)


OTHER = {"pad_counts_per_n": 800, "side_counts_per_n": 100, "edge_counts_per_n": 200}


@every_case(
    ("identity", "swap", "left", "right", "pads_n", "edges_n"),
    [
        ({}, False, {7: 800, 21: 800, 1: 200}, {14: 3200, 3: 600}, (1.0, 2.0), (0.5, 1.0)),
        (OTHER, False, {10: 800, 6: 100}, {5: 100}, (1.0, 0.0), (1.0, 0.5)),
        ({}, True, {7: 1600}, {}, (0.0, 1.0), (0.0, 0.0)),
    ],
)
def test_newtons_per_region(identity, swap, left, right, pads_n, edges_n, device_identity):
    """1600 counts/N on the pad, 400 on the sides, 600 on the other edge cells (fingertip_geometry.py).

    Another device says its own, and fingers can be swapped.
    """
    measure = tared(device_identity(**identity), Pr2Config(swap_fingers=swap))
    frame = measure.reading(report(), image(9, left, right)).frame
    assert (frame.force_left_n, frame.force_right_n) == pytest.approx(pads_n)
    assert (frame.edge_left_n, frame.edge_right_n) == pytest.approx(edges_n)
    assert frame.status == 0


@every_case("dead", [0x0000, 0xFFFF])
def test_cell_that_does_not_answer_adds_no_force_and_is_flagged(dead, device_identity):
    measure = tared(device_identity())
    cells = list(image(9, left={7: 1600}).cells)
    cells[12] = dead
    frame = measure.reading(report(), RawImage(9, 9000, tuple(cells))).frame
    assert (frame.force_left_n, frame.status, measure.bad_cells) == (pytest.approx(1.0), BAD_CELL, 1)


def test_whole_tip_that_does_not_answer_has_no_force(device_identity):
    dead = RawImage(9, 0, (0.0,) * 22 + tuple(TIP))
    frame = tared(device_identity()).reading(report(), dead).frame
    assert math.isnan(frame.force_left_n)
    assert frame.force_right_n == pytest.approx(0.0)


def test_mirroring_swaps_the_z_sides_of_one_tip(device_identity):
    """Left column i is cells 7+i+3k, the mirrored one 9-i+3k; side 1 and 6, corner 2 and 5, tip 3 and 4."""
    measure = Measure(device_identity(), Pr2Config(mirror_left=True), None, None)
    cells = tuple(range(100, 144))
    pads = measure.reading(report(), RawImage(1, 0, cells)).pads
    assert pads.left[:7] == (100, 106, 105, 104, 103, 102, 101)
    for k in range(5):
        assert pads.left[7 + 3 * k : 10 + 3 * k] == (109 + 3 * k, 108 + 3 * k, 107 + 3 * k)
    assert pads.right == cells[22:]


def test_load_table_gives_newtons_of_the_load_cell_and_says_where_it_ends(device_identity):
    table = LoadTable((0.0, 2.0, 4.0), (0.0, 3.0, 5.0))
    measure = tared(device_identity(), tables=(table, table))
    inside = measure.reading(report(), image(9, left={7: 4800}, right={7: 1600})).frame
    assert (inside.force_left_n, inside.force_right_n, inside.status) == pytest.approx((4.0, 1.5, 0))
    beyond = measure.reading(report(), image(10, left={7: 8000})).frame
    assert beyond.force_left_n == pytest.approx(6.0)
    assert beyond.status == BEYOND_TABLE


def test_steady_load_is_refused_against_the_stored_tare(device_identity):
    measure = Measure(device_identity(), Pr2Config(), (TIP, TIP), None)
    loaded = tuple(c + 400.0 if i >= 7 else c for i, c in enumerate(TIP))  # 15 cells x 400 = 3.75 N
    with pytest.raises(TareRefused, match=r"right pad .*\+3\.75 N.*3\.0 N"):
        measure.tare([Pads(0.0, 1, TIP, loaded)])


def test_without_a_stored_tare_an_improbable_zero_is_refused(device_identity):
    heavy = (4700.0,) * 22
    with pytest.raises(TareRefused, match=r"right pad .*4700.*4500"):
        Measure(device_identity(), Pr2Config(), None, None).tare([Pads(0.0, 1, TIP, heavy)])
    Measure(device_identity(), Pr2Config(), (heavy, heavy), None).tare([Pads(0.0, 1, heavy, heavy)])


def test_cell_dead_during_the_tare_stays_out_when_it_comes_back(device_identity):
    measure = Measure(device_identity(), Pr2Config(), None, None)
    dead = (*TIP[:9], 0.0, *TIP[10:])
    measure.tare([Pads(0.0, i, dead, TIP) for i in (1, 2)])
    frame = measure.reading(report(), image(9, left={7: 1600})).frame
    assert (frame.force_left_n, frame.status) == (pytest.approx(1.0), BAD_CELL)


def test_time_begins_with_the_first_report(device_identity):
    measure = Measure(device_identity(), Pr2Config(), None, None)
    frames = [measure.reading(report(time_us=time_us), None).frame for time_us in (7_000_000, 7_003_000)]
    assert [(frame.t_s, frame.dt_s) for frame in frames] == [(0.0, 0.001), (0.003, 0.003)]
