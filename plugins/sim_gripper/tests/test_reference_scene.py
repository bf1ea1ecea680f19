"""The scene on which other engines are measured: a constant mass on a light surface, against its own equations."""

import numpy as np
import pytest
from batches import run_many
from peer_scenes import CONFIG, KC, LIGHT, TICK, TICKS, X0, B, C, K, Law, M, closed_law

from graspsense.simulator_api import RunConfig


def rates(state, u):
    x, v, y, w = state
    force = KC * max(x - y - X0, 0.0)
    return np.array([v, (u - B * v - force) / M, w, (force - K * y - C * w) / LIGHT])


def solved(u_of, ticks):
    """Return the force at each tick, by four Runge-Kutta steps a tick: within 1e-6 of its peak.

    `u_of(t, x, v, f)` gives what is commanded from each tick on.
    """
    state, h, forces = np.zeros(4), TICK / 4, np.zeros(ticks)
    for tick in range(ticks):
        forces[tick] = KC * max(state[0] - state[2] - X0, 0.0)
        u = u_of(tick * TICK, state[0], state[1], forces[tick])
        for _ in range(4):
            k1 = rates(state, u)
            k2 = rates(state + 0.5 * h * k1, u)
            k3 = rates(state + 0.5 * h * k2, u)
            k4 = rates(state + h * k3, u)
            state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return forces


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

    force = solved(law, TICKS)
    simulated = done.trace.force_left_n[: len(force)]
    peak = force.max()
    assert np.sqrt(np.mean((simulated - force) ** 2)) < accuracy * peak
    assert done.state.peak_n == pytest.approx(peak, rel=accuracy)
    assert done.report()["not_verified"] == []
