"""Ticks of an approach that are run at once give what the same ticks give one by one, with the encoder's noise too."""

import numpy as np
import pytest
from batches import run_many
from cases import slow

from graspsense.plugin_api import APPROACH, create
from graspsense_sim_gripper.config import SimConfig

TICK_BY_TICK = {"fidelity": "fixed"}
HYBRID = create("controller", "hybrid")
RINGING = create("controller", "hybrid", velocity_gain_n_s_m=1500.0, integral_gain_n_m=1e5)
"""Gains with which the loop of the speed is hardly damped."""
ENCODER_TICK_M = 0.34e-6
"""The gap of one tick of the encoder is smaller at every gap of an approach."""


def approach(sensor, law, scene, **settings):
    """Return the grasp, and the columns of its approach."""
    grasp = run_many(SimConfig(sensor=sensor, **settings), law, [scene], [7])[0]
    rows = grasp.trace.phase == APPROACH
    return grasp, grasp.trace.gap_m[rows], grasp.trace.velocity_m_s[rows]


def closing_at(speed_m_s):
    return create("controller", "hybrid", closing_speed_m_s=speed_m_s)


@pytest.mark.parametrize("sensor", ["ideal", "pads"])
@pytest.mark.parametrize(
    ("law", "scene"),
    [
        pytest.param(closing_at(0.04), "odwalla:full_closed", id="fast"),
        # The toy stands off the centre, and a finger pushes it across the table.
        slow(closing_at(0.04), "toy", id="pushed"),
        slow(closing_at(0.004), "toy", id="slow"),
        slow(HYBRID, "odwalla:full_closed", id="default"),
        # A constant effort above friction accelerates the fingers up to the contact.
        slow(create("controller", "force"), "odwalla:full_closed", id="accelerating"),
        slow(RINGING, "odwalla:full_closed", id="ringing"),
        # Near the limit of 0.2 m/s, which the guard enforces.
        slow(closing_at(0.199), "odwalla:full_closed", id="limit"),
    ],
)
def test_the_fingers_move_as_they_do_tick_by_tick(sensor, law, scene):
    agree(sensor, law, scene)


@pytest.mark.parametrize(("rate_hz", "speed_m_s"), [(200.0, 0.04), slow(500.0, 0.1)])
def test_a_run_of_long_ticks_ends_with_the_polynomial_of_the_linkage(rate_hz, speed_m_s):
    # The Jacobian changes by more than its polynomial is made for in fewer ticks than a run may have: beyond it, gaps
    # were 7 um off. Single ticks of this length have errors of their own.
    agree("ideal", closing_at(speed_m_s), "toy", gap_error_m=5e-7, speed_error_m_s=2e-4, rate_hz=rate_hz)


def agree(sensor, law, scene, gap_error_m=3e-7, speed_error_m_s=1e-6, **settings):
    """Assert that an approach is that of the same ticks one by one, within these errors and what the encoder adds."""
    at_once, gap, velocity = approach(sensor, law, scene, **settings)
    single, expected_gap, expected = approach(sensor, law, scene, **TICK_BY_TICK, **settings)
    assert at_once.outcome == single.outcome
    assert at_once.state.step.n_steps < 0.4 * len(at_once.trace.t_s)
    # The contact is detected in the same tick: what the encoder's noise does to the motion is followed.
    assert len(gap) == len(expected_gap)
    if sensor != "ideal":
        gap_error_m, speed_error_m_s = gap_error_m + ENCODER_TICK_M, speed_error_m_s + 1.5e-4
    np.testing.assert_allclose(gap, expected_gap, rtol=0.0, atol=gap_error_m)
    # The error of each of some twenty steps is relative to the speed.
    np.testing.assert_allclose(velocity, expected, rtol=6e-4, atol=speed_error_m_s)


@pytest.mark.slow
@pytest.mark.parametrize("law", [HYBRID, RINGING], ids=["default", "ringing"])
def test_the_speed_that_the_encoder_shows_scatters_as_tick_by_tick(law):
    _, _, velocity = approach("pads", law, "odwalla:full_closed")
    _, _, expected = approach("pads", law, "odwalla:full_closed", **TICK_BY_TICK)
    assert np.std(velocity[300:]) == pytest.approx(np.std(expected[300:]), rel=0.01)
    assert np.mean(velocity[300:]) == pytest.approx(np.mean(expected[300:]), rel=1e-5)


def test_a_subclass_with_another_step_does_not_inherit_the_law_of_free_motion():
    class Gentler(type(HYBRID)):
        step = staticmethod(lambda params, state, reading: type(HYBRID).step(params, state, reading))

    assert type(HYBRID).step.free_motion is not None
    assert getattr(Gentler.step, "free_motion", None) is None
