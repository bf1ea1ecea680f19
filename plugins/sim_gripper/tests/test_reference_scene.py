"""The scene on which other engines are measured: a constant mass on a light surface, against an exact solution."""

import numpy as np
import pytest
from simulation_scene import CONFIG, OPEN_M, TICK, Law, exact, exact_closed
from unverified import unverified_setup

from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.run.batch import run_many
from graspsense_sim_gripper.run.compiled.compose import plant_move
from graspsense_sim_gripper.scene.terms.registry import laws_of


def profile(t):
    """Return the force that is asked for: 1 N to find the surface, up to 15 N, down to 5 N."""
    up = min(1.0 + max(10.0 * (t - 0.6), 0.0), 15.0)
    return up if t <= 5.0 else max(15.0 - 10.0 * (t - 5.0), 5.0)


@pytest.mark.parametrize("ticks", [600, pytest.param(7000, marks=pytest.mark.long)])
def test_the_open_loop_profile_gives_the_exact_trace(ticks):
    setup = unverified_setup(CONFIG, CONFIG.object, 0)
    move, state = plant_move(laws_of(setup.kinds)), setup.state
    gaps, forces = [], []
    for tick in range(ticks):
        state = move(setup.plant, state, profile(tick * TICK), TICK)
        gaps.append(state.motion.gap_m)
        forces.append(state.contact.left_n)
    # Its columns are of the beginning of each tick, the plant's of the end.
    run = exact(lambda tick, x, v, f: profile(tick * TICK), ticks + 1)
    gap, force = OPEN_M - run.x[1:], run.force[1:]
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
    force = exact_closed().force
    simulated = done.trace.force_left_n[: len(force)]
    peak = force.max()
    assert np.sqrt(np.mean((simulated - force) ** 2)) < accuracy * peak
    assert done.state.peak_n == pytest.approx(peak, rel=accuracy)
    assert done.report()["not_verified"] == []
