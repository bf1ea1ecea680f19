"""The accelerometer of the palm: what acts on it, its noise, and the same samples however a grasp runs."""

from math import cos, sin, sqrt

import numpy as np
import pytest
from attrs import evolve

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.signals import Phase
from graspsense.plugin_api import create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.drive_models import LINKAGES, STRAIGHT
from graspsense_sim_gripper.plant.palm import (
    ARM_HZ,
    AT_REST,
    FLOOR_M_S2,
    FREE_FALL_M_S2,
    GEAR_M_S2_REV_S,
    PALM_KG,
    SWINGING_KG,
    PalmBuffers,
    palm_params,
    palm_signals,
    swing_force,
)
from graspsense_sim_gripper.plant.state import Contact, ContactState, Motion, PlantState
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.run.batch import run_many

HYBRID = create("controller", "hybrid")
CAN = SimConfig(object="can:empty_open", acceleration=True)
TICK_S = 1e-3


def grasp(config, seed=5):
    return run_grasp(SimBackend(config), HYBRID, RunConfig(seed=seed)).trace


def acceleration(trace):
    return trace.signals["acceleration"]


def plant(left_n, right_n):
    untouched = ContactState(0.0, 0.0, 0.0, ())
    return PlantState(Motion(100.0, 0.0, 0.04, 4e-4), Contact(left_n, right_n, 0.0, 0, untouched, ()))


def felt(forces_n):
    """Return the acceleration in each tick in which these forces act on the left pad, without noise."""
    params, state, rows = palm_params(LINKAGES["pr2"], TICK_S, ideal=True), AT_REST, []
    buffers = PalmBuffers([[0.0] * 9], ())
    for tick, force_n in enumerate(forces_n):
        signals, state = palm_signals(
            params, state, plant(force_n, 0.0), tick * TICK_S, TICK_S, tick, buffers
        )
        rows += signals.acceleration.values[:3]
    return np.array(rows)


@pytest.mark.parametrize("sensor", ["pads", pytest.param("ideal", marks=pytest.mark.slow)])
def test_the_loop_gives_the_samples_of_the_runner(sensor):
    check_loop(evolve(CAN, sensor=sensor), compiled=False)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["pads", "ideal"])
def test_the_compiled_loop_gives_the_samples_of_the_runner(sensor):
    pytest.importorskip("numba", reason="the compiled loop needs the extra `fast`")
    check_loop(evolve(CAN, sensor=sensor), compiled=True)


def check_loop(config, compiled):
    run = grasp(config)
    batch = run_many(config, HYBRID, [config.object], [5], compiled=compiled)[0].trace
    assert acceleration(batch).t_s.tobytes() == acceleration(run).t_s.tobytes()
    np.testing.assert_allclose(acceleration(batch).values, acceleration(run).values, rtol=1e-9, atol=1e-12)
    assert len(acceleration(run).t_s) == 3 * len(run)
    assert acceleration(run).lost == 0


def test_the_accelerometer_changes_nothing_else():
    with_it, without = grasp(CAN), grasp(evolve(CAN, acceleration=False))
    assert without.signals == {}
    for name in (
        "t_s",
        "gap_m",
        "velocity_m_s",
        "force_left_n",
        "force_right_n",
        "command",
        "phase",
        "pad_left",
    ):
        np.testing.assert_array_equal(getattr(with_it, name), getattr(without, name), err_msg=name)


def test_a_seed_gives_its_own_noise_each_time():
    first, again, other = grasp(CAN), grasp(CAN), grasp(CAN, seed=6)
    assert acceleration(first).values.tobytes() == acceleration(again).values.tobytes()
    assert acceleration(first).values[:9].tobytes() != acceleration(other).values[:9].tobytes()


def test_a_resting_palm_shows_free_fall_and_the_floor_of_the_noise():
    trace = grasp(CAN)
    held = acceleration(trace).values[np.repeat(trace.phase == Phase.HOLD, 3)]
    n = len(held)
    assert n > 300
    # Five standard errors of mean and standard deviation of n normal numbers.
    assert held.mean(axis=0) == pytest.approx([0.0, 0.0, FREE_FALL_M_S2], abs=5 * FLOOR_M_S2 / sqrt(n))
    assert held.std(axis=0) == pytest.approx([FLOOR_M_S2] * 3, rel=5 / sqrt(2 * n))


def test_moving_gears_add_noise_in_proportion_to_the_speed_of_the_motor():
    trace = grasp(evolve(CAN, object="none"))
    moving = (trace.phase == Phase.APPROACH) & (trace.t_s > trace.t_s[0] + 0.3)
    vertical = acceleration(trace).values[np.repeat(moving, 3), 2]
    speed_m_s = np.median(np.abs(trace.velocity_m_s[moving]))
    # 0.36 to 0.46 mm of the gap a revolution.
    slow, fast = (
        sqrt(FLOOR_M_S2**2 + (GEAR_M_S2_REV_S * speed_m_s / per_rev) ** 2) for per_rev in (4.7e-4, 3.5e-4)
    )
    assert 0.95 * slow < vertical.std() < 1.05 * fast


def test_a_force_on_one_pad_first_accelerates_the_whole_gripper_and_then_the_arm_bears_it():
    rows = felt([0.0, *[2.0] * 4000])
    # 2 N to the left on 1.01 kg; within the tick in which the force rises, the arm has hardly given way.
    assert rows[5] == pytest.approx([0.0, 2.0 / PALM_KG, FREE_FALL_M_S2], abs=0.05)
    assert np.abs(rows[-300:, :2]).max() < 1e-6


def test_the_gripper_swings_on_its_arm_at_the_arms_frequency():
    across = felt([0.0, *[2.0] * 400])[6:, 1]
    crossings = np.flatnonzero(np.diff(np.sign(across)))[:5]
    period_s = 2 * np.diff(crossings).mean() / 3000.0
    assert period_s == pytest.approx(1.0 / (ARM_HZ * sqrt(1 - 0.2**2)), rel=0.03)


def test_equal_forces_on_both_pads_are_not_felt():
    params = palm_params(LINKAGES["pr2"], TICK_S, ideal=True)
    signals, _ = palm_signals(
        params, AT_REST, plant(20.0, 20.0), 0.0, TICK_S, 0, PalmBuffers([[0.0] * 9], ())
    )
    assert signals.acceleration.values[2] == pytest.approx((0.0, 0.0, FREE_FALL_M_S2))


@pytest.mark.parametrize("name", ["pr2", "pr2_2009"])
def test_the_swing_of_the_fingers_pushes_the_palm_back(name):
    """Against the second difference of the fingertips' position along x, of fingers on arcs."""
    link = LINKAGES[name]
    params = palm_params(link, TICK_S, ideal=True)

    def along_m(t_s):
        half = 0.5 * gap_m(t_s) - link.half_gap0_m
        return sqrt(link.finger_m**2 - half**2)

    def gap_m(t_s):
        return 0.05 + 0.01 * sin(5.0 * t_s)

    t, h = 0.13, 1e-4
    rate, rate_rate = 0.05 * cos(5.0 * t), -0.25 * sin(5.0 * t)
    expected = (along_m(t + h) - 2 * along_m(t) + along_m(t - h)) / h**2 * -2.0 * SWINGING_KG
    assert swing_force(params, gap_m(t), rate, rate_rate) == pytest.approx(expected, rel=1e-5)
    assert swing_force(palm_params(STRAIGHT, TICK_S, ideal=True), 0.05, rate, rate_rate) == 0.0


@pytest.mark.slow
def test_a_grasp_longer_than_the_noise_that_was_drawn_first_is_whole():
    slow = create("controller", "hybrid", closing_speed_m_s=0.003)
    config = SimConfig(object="block", acceleration=True)
    run = run_grasp(SimBackend(config), slow, RunConfig(seed=2)).trace
    assert len(run) > 8200
    for compiled in (False, True):
        batch = run_many(config, slow, ["block"], [2], compiled=compiled)[0].trace
        np.testing.assert_allclose(
            acceleration(batch).values, acceleration(run).values, rtol=1e-9, atol=1e-12
        )
