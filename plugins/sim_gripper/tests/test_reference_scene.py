"""The scene on which other engines are measured: a constant mass on a light surface, against its own equations."""

import numpy as np
import pytest
from simulation_scene import CONFIG, KC, LIGHT, OPEN_M, TICK, TICKS, X0, B, C, K, Law, M, closed_law
from unverified import unverified_setup

from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.run.batch import run_many
from graspsense_sim_gripper.run.compiled.compose import plant_move
from graspsense_sim_gripper.scene.terms.registry import laws_of


def rates(state, u):
    x, v, y, w = state
    force = KC * max(x - y - X0, 0.0)
    return np.array([v, (u - B * v - force) / M, w, (force - K * y - C * w) / LIGHT])


def solved(u_of, ticks):
    """Return gap closed and force at each tick, by four Runge-Kutta steps a tick: within 1e-6 of the peak force.

    `u_of(t, x, v, f)` gives what is commanded from each tick on.
    """
    state, h = np.zeros(4), TICK / 4
    xs, forces = np.zeros(ticks), np.zeros(ticks)
    for tick in range(ticks):
        xs[tick], forces[tick] = state[0], KC * max(state[0] - state[2] - X0, 0.0)
        u = u_of(tick * TICK, state[0], state[1], forces[tick])
        for _ in range(4):
            k1 = rates(state, u)
            k2 = rates(state + 0.5 * h * k1, u)
            k3 = rates(state + 0.5 * h * k2, u)
            k4 = rates(state + h * k3, u)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return xs, forces


def profile(t):
    """Return the force that is asked for: 1 N to find the surface, up to 15 N, down to 5 N."""
    up = min(1.0 + max(10.0 * (t - 0.6), 0.0), 15.0)
    return up if t <= 5.0 else max(15.0 - 10.0 * (t - 5.0), 5.0)


@pytest.mark.parametrize("ticks", [600, pytest.param(7000, marks=pytest.mark.long)])
def test_the_open_loop_profile_gives_the_trace_of_the_equations(ticks):
    setup = unverified_setup(CONFIG, CONFIG.object, 0)
    move, state = plant_move(laws_of(setup.kinds)), setup.state
    gaps, forces = [], []
    for tick in range(ticks):
        state = move(setup.plant, state, profile(tick * TICK), TICK)
        gaps.append(state.motion.gap_m)
        forces.append(state.contact.left_n)
    # Its columns are of the beginning of each tick, the plant's of the end.
    xs, solution_n = solved(lambda t, x, v, f: profile(t), ticks + 1)
    gap, force = OPEN_M - xs[1:], solution_n[1:]
    peak = force.max()
    assert peak > 1.0
    assert np.max(np.abs(np.array(gaps) - gap)) < 1e-5
    assert np.sqrt(np.mean((np.array(forces) - force) ** 2)) < 1e-2 * peak
    assert state.contact.left_n == pytest.approx(state.contact.right_n)


@pytest.mark.slow
def test_a_grasp_of_linear_contact_has_the_accuracy_that_is_asked_for():
    """Every term is linear and the drive is straight. Its steps are those of any other scene."""
    run, accuracy = RunConfig(hold_s=0.0), CONFIG.accuracy
    done = run_many(CONFIG, Law(None), [CONFIG.object], [0], compiled=False, run=run)[0]
    integral_n, since_s = 0.0, -1.0

    def law(t, x, v, f):
        nonlocal integral_n, since_s
        u, integral_n, since_s = closed_law(t, x, v, f, integral_n, since_s)
        return u

    _, force = solved(law, TICKS)
    simulated = done.trace.force_left_n[: len(force)]
    peak = force.max()
    assert np.sqrt(np.mean((simulated - force) ** 2)) < accuracy * peak
    assert done.state.peak_n == pytest.approx(peak, rel=accuracy)
    assert done.report()["not_verified"] == []
