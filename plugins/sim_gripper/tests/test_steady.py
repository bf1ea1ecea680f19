"""A steady approach, whose ticks are run at once: the fingers arrive when and as they do tick by tick."""

import numpy as np
import pytest

from graspsense.plugin_api import APPROACH, create
from graspsense_sim_gripper.batch import run_many
from graspsense_sim_gripper.config import SimConfig

TICK_BY_TICK = {"fidelity": "fixed", "scheme": "explicit"}
HYBRID = create("controller", "hybrid")


def approach(sensor, law=HYBRID, scene="odwalla:full_closed", **settings):
    """Return the grasp, and the columns of its approach."""
    grasp = run_many(SimConfig(sensor=sensor, **settings), law, [scene], [7])[0]
    rows = grasp.trace.phase == APPROACH
    return grasp, grasp.trace.gap_m[rows], grasp.trace.velocity_m_s[rows]


@pytest.mark.parametrize("scene", ["odwalla:full_closed", "toy"])
@pytest.mark.parametrize(
    "speed_m_s", [*(pytest.param(v, marks=pytest.mark.slow) for v in (0.004, 0.01)), 0.04]
)
def test_the_fingers_arrive_when_they_do_tick_by_tick(scene, speed_m_s):
    # The toy stands off the centre, and a finger pushes it across the table.
    law = create("controller", "hybrid", closing_speed_m_s=speed_m_s)
    at_once, gap, velocity = approach("ideal", law, scene)
    _, expected_gap, expected = approach("ideal", law, scene, **TICK_BY_TICK)
    assert at_once.state.step.n_steps < 0.5 * len(at_once.trace.t_s)
    assert abs(len(gap) - len(expected_gap)) <= 1
    n = min(len(gap), len(expected_gap))
    # A twentieth of the way in a tick.
    np.testing.assert_allclose(gap[:n], expected_gap[:n], atol=0.05 * speed_m_s * 1e-3)
    np.testing.assert_allclose(velocity[:n], expected[:n], atol=1e-3 * speed_m_s)


def test_the_encoder_is_read_at_each_of_its_ticks():
    _, gap, velocity = approach("pads")
    _, expected_gap, expected = approach("pads", **TICK_BY_TICK)
    assert abs(len(gap) - len(expected_gap)) <= 2
    later = slice(300, min(len(gap), len(expected_gap)) - 200)
    np.testing.assert_allclose(gap[later], expected_gap[later], atol=1e-5)
    # The ticks of the encoder make the speed that it shows vary by a quarter of a per cent.
    assert np.std(velocity[later]) == pytest.approx(np.std(expected[later]), rel=0.2)
    assert np.mean(velocity[later]) == pytest.approx(np.mean(expected[later]), rel=1e-3)


def test_an_approach_that_accelerates_is_not_steady():
    # A constant effort above friction accelerates the fingers up to the contact.
    force = create("controller", "force")
    at_once, gap, _ = approach("ideal", force)
    _, expected, _ = approach("ideal", force, **TICK_BY_TICK)
    assert len(gap) == len(expected)
    np.testing.assert_allclose(gap, expected, atol=1e-6)
    assert at_once.reduction.steps.macro_tolerance > 0.0


def test_a_speed_that_rings_is_not_steady():
    # Gains with which the loop is hardly damped: at each extremum the acceleration is zero.
    ringing = create("controller", "hybrid", velocity_gain_n_s_m=1500.0, integral_gain_n_m=1e5)
    _, gap, velocity = approach("pads", ringing)
    _, expected_gap, expected = approach("pads", ringing, **TICK_BY_TICK)
    n = min(len(gap), len(expected_gap))
    np.testing.assert_allclose(gap[:n], expected_gap[:n], atol=1e-5)
    assert np.std(velocity[300:n]) == pytest.approx(np.std(expected[300:n]), rel=0.02)


def test_the_limits_of_the_gripper_hold():
    # Near the limit of 0.2 m/s, which the guard enforces.
    fast = create("controller", "hybrid", closing_speed_m_s=0.199)
    at_once, _, velocity = approach("pads", fast)
    single, _, expected = approach("pads", fast, **TICK_BY_TICK)
    assert at_once.outcome == single.outcome
    assert np.max(np.abs(velocity)) == pytest.approx(np.max(np.abs(expected)), rel=0.01)
