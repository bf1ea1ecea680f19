"""How far one grasp is from another: instants inside the tick, scales below which nothing counts, kinds that differ."""

import math

import numpy as np
import pytest
from attrs import evolve
from batches import run_many
from cases import every_case
from random_scenes import record_of

from graspsense.plugin_api import REST_WINDOW_S, STEADY, create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.error import GraspRecord, deviation

SPEED, TAU, STIFFNESS = 0.01, 0.05, 2000.0


def squeeze(dt=1e-3, late=0.0, stiffness=STIFFNESS, outcome=STEADY):
    """A face that moves at 10 mm/s until 0.1 s, then comes to rest over 50 ms; it touches at 45 mm."""
    t = np.arange(0.0, 1.0, dt) + late
    after = np.maximum(t - 0.1, 0.0)
    travel = np.where(t < 0.1, SPEED * t, SPEED * (0.1 + TAU * (1.0 - np.exp(-after / TAU))))
    speed = np.where(t < 0.1, SPEED, SPEED * np.exp(-after / TAU))
    gap = 0.0455 - travel
    force = stiffness * np.maximum(0.045 - gap, 0.0)
    peak_n, both = float(force.max()), {"left_n": force, "right_n": force}
    rows = {"gap_m": gap, "speed_m_s": -speed, "n_rows": len(t), **both}
    return GraspRecord(outcome=outcome, dt_s=dt, peak_n=peak_n, **rows)


def test_the_quantities_are_those_of_the_motion_whatever_the_clock():
    touches = (0.0005 + 0.625 / STIFFNESS) / SPEED
    rests = 0.1 + TAU * math.log(SPEED / 1e-4)
    for dt in (1e-3, 2e-4):
        quantities = squeeze(dt).quantities
        assert quantities["delta_t"] == pytest.approx(rests - touches, abs=1e-5)
        assert quantities["p_first"] == pytest.approx(0.045 - 0.625 / STIFFNESS, abs=1e-9)


@every_case("late", [1e-4, 3.7e-4, 9e-4])
def test_when_the_clock_ticks_hardly_matters(late):
    assert squeeze(late=late).quantities == pytest.approx(squeeze().quantities, rel=2e-4)


def test_a_grasp_is_not_far_from_itself_and_a_stiffer_one_by_so_much():
    assert deviation(squeeze(), squeeze())[0] == 0.0
    error, whose = deviation(squeeze(stiffness=1.01 * STIFFNESS), squeeze())
    assert 0.009 < error < 0.03
    assert whose


def test_below_its_scale_a_quantity_counts_as_if_it_were_that():
    soft = squeeze(stiffness=1e-3)
    assert deviation(evolve(soft, peak_n=soft.peak_n + 0.001), soft) == (pytest.approx(0.001), "peak")


def test_grasps_of_two_kinds_are_without_bound_from_each_other():
    assert deviation(squeeze(outcome=7), squeeze()) == (math.inf, "outcome")
    never = evolve(squeeze(), speed_m_s=np.full(1000, -SPEED))
    assert deviation(never, squeeze())[0] == math.inf
    assert deviation(squeeze(), never)[0] == math.inf


def test_a_rest_before_the_hold_is_not_the_one_that_is_meant():
    # At rest from 0.2 to 0.4 s, pressed further until 0.6 s, at rest again: the controller waited for a force.
    t = np.arange(0.0, 1.0, 1e-3)
    way = 0.01 * (np.minimum(t, 0.2) + np.clip(t - 0.4, 0.0, 0.2))
    gap, force = 0.0455 - way, STIFFNESS * np.maximum(way - 0.0005, 0.0)
    moving = (t < 0.2) | ((t >= 0.4) & (t < 0.6))
    speed = np.where(moving, -0.01, 0.0)
    forces = {"left_n": force, "right_n": force}
    record = evolve(squeeze(), gap_m=gap, speed_m_s=speed, hold_from=int(np.sum(t < 0.7)), **forces)
    quantities = record.quantities
    # Pressed by 10 mm/s for 0.4 s, of which 0.5 mm without contact: not by the half of it.
    assert quantities["f_steady"] == pytest.approx(STIFFNESS * 0.0035, rel=1e-3)
    assert quantities["p_steady"] == pytest.approx(0.0415, abs=1.5e-5)


@every_case(("hold_from", "row"), [(900, 900), (1000, None)])
def test_the_steady_force_is_that_of_the_hold_or_of_the_rest_if_there_is_no_hold(hold_from, row):
    creeping = 2.0 + np.arange(1000) * 1e-3
    record = evolve(squeeze(), left_n=creeping, right_n=creeping, hold_from=hold_from)
    if row is None:
        row = 1000 * (0.1 + TAU * math.log(SPEED / 1e-4) + REST_WINDOW_S)
    assert record.quantities["f_steady"] == pytest.approx(2.0 + row * 1e-3, abs=2e-4)


def test_at_rest_from_the_very_contact_on_there_is_no_rate():
    creeping = evolve(squeeze(), speed_m_s=np.full(1000, -5e-5))
    quantities = creeping.quantities
    assert quantities["delta_t"] == 0.0
    assert math.isnan(quantities["dp_dt"])
    assert math.isnan(quantities["df_dt"])


@pytest.mark.slow
def test_they_are_the_feature_sets_own_to_a_tick():
    config = SimConfig(sensor="ideal", spread=False, open_gap_m=0.065)
    (grasp,) = run_many(config, create("controller", "hybrid"), ["odwalla:full_closed"], [0])
    drawn = create("feature-set", "chitta").extract(grasp.trace).as_dict()
    quantities = record_of(grasp, 1e-3).quantities
    # The feature set's rest is told from the way in 50 ms, which begins a little before the speed is as low.
    assert quantities["delta_t"] == pytest.approx(drawn["delta_t"], abs=0.05)
    assert quantities["p_first"] == pytest.approx(drawn["p_first"], abs=1.5e-5)
    assert quantities["f_steady"] == pytest.approx(drawn["f_steady"], rel=0.01)
