"""Whole grasps that the paper and its authors' notes speak of: what must come out, and by how much."""

import numpy as np
import pytest
from batches import run_many

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.gripper_api import Outcome, Phase
from graspsense.plugin_api import create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend

pytestmark = pytest.mark.slow
FEATURES = create("feature-set", "chitta")


def grasp(controller, seed=0, **config):
    return run_grasp(SimBackend(SimConfig(**config)), controller, RunConfig(seed=seed))


def peaks(name, force_n, scene, seeds):
    controller = create("controller", name, probing_force_n=force_n)
    done = run_many(SimConfig(), controller, [scene] * len(seeds), seeds)
    return done, np.array([grasp.state.peak_n for grasp in done])


def test_on_the_block_pure_force_slams_at_least_three_times_the_hybrids_peak():
    # Fig. 5 against Fig. 6, by the true force, at 23 N. The approach begins with an image of the pads, so opening
    # wider by up to 0.41 mm (41 ms at 10 mm/s) moves the contact through every phase of their clock.
    phases = 41
    peak = {"hybrid": [], "force": []}
    for name, peaks_n in peak.items():
        controller = create("controller", name, probing_force_n=23.0)
        for k in range(phases):
            config = SimConfig(spread=False, open_gap_m=0.086 + k * 0.41e-3 / phases)
            done = run_many(config, controller, ["block"], [0], compiled=True)[0]
            assert done.outcome is Outcome.STEADY
            peaks_n.append(done.state.peak_n)
    # The worst hybrid grasp stands against the gentlest slam.
    assert min(peak["force"]) > 3.0 * max(peak["hybrid"])
    # And the phase of the clock does matter: the loop pushes on until the next image.
    assert max(peak["hybrid"]) > 1.05 * min(peak["hybrid"])


def test_the_egg_survives_the_hybrid_and_not_pure_force():
    seeds = range(100)
    hybrid, gentle = peaks("hybrid", 20.0, "egg", seeds)
    slammed, _ = peaks("force", 20.0, "egg", seeds)
    assert [grasp.state.contact.left.states[0].broken for grasp in hybrid] == [0] * 100
    assert [grasp.state.contact.left.states[0].broken for grasp in slammed] == [1] * 100
    # The margin: the weakest of these eggs breaks at 23 N, and no hybrid grasp goes over 22 N.
    assert gentle.max() < 22.0
    assert {grasp.outcome for grasp in slammed} == {Outcome.CRUSHED}


def test_velocity_control_on_its_own_raises_its_effort_after_contact_and_crushes():
    result = grasp(create("controller", "velocity"), object="egg", open_gap_m=0.048)
    trace = result.trace
    approaching = trace.command[trace.phase == Phase.APPROACH]
    after = trace.command[trace.phase == Phase.SQUEEZE]
    # Moving freely takes the friction's 7 N or so; against the egg it goes on rising until something gives.
    assert np.median(approaching) < 9.0
    assert after.max() > 40.0
    assert result.report["broken"]
    assert result.outcome is Outcome.CRUSHED


@pytest.mark.parametrize("name", ["force", "hybrid"])
def test_a_force_below_breakaway_does_not_move_the_gripper_at_all(name):
    options = {"probing_force_n": 6.0, "move_timeout_s": 0.3}
    if name == "hybrid":
        # The velocity loop would raise its effort until it moves; held to the same 6 N it does not either.
        options |= {"velocity_gain_n_s_m": 0.0, "integral_gain_n_m": 0.0, "preload_n": 6.0}
    result = grasp(create("controller", name, **options), spread=False, fidelity="fixed")
    approach = result.trace.gap_m[result.trace.phase == Phase.APPROACH]
    assert len(set(approach.tolist())) == 1
    assert result.outcome is Outcome.NOTHING_THERE


def test_closed_loop_force_settles_at_the_force_asked_for():
    controller = create("controller", "hybrid", loop="closed", probing_force_n=5.0, steady_timeout_s=8.0)
    result = grasp(controller, object="toy", spread=False, open_gap_m=0.06)
    assert result.outcome is Outcome.STEADY
    assert FEATURES.extract(result.trace)["f_steady"] == pytest.approx(5.0, abs=0.3)


def test_a_ramp_softens_the_switch():
    hard, ramped = (
        grasp(create("controller", "hybrid", ramp_s=ramp), spread=False, object="block", open_gap_m=0.033)
        for ramp in (0.0, 0.3)
    )
    jumps = []
    for trace in (hard.trace, ramped.trace):
        switch = int((trace.phase == Phase.SQUEEZE).argmax())
        jumps.append(abs(trace.command[switch + 1] - trace.command[switch - 1]))
    assert jumps[1] < 0.1 * jumps[0]


@pytest.mark.parametrize(
    ("config", "law", "outcome"),
    [
        ({"object": "none"}, {}, Outcome.NOTHING_THERE),
        ({"object": "can:full_closed", "open_gap_m": 0.060}, {}, Outcome.TOO_WIDE),
        ({"object": "odwalla:empty_open", "open_gap_m": 0.064}, {}, Outcome.STEADY),
        # A slow approach stretches its time out.
        ({"object": "block"}, {"closing_speed_m_s": 0.002}, Outcome.STEADY),
    ],
)
def test_outcomes(config, law, outcome):
    assert grasp(create("controller", "hybrid", **law), **config).outcome is outcome


def test_the_states_of_a_bottle_lie_where_the_authors_tree_splits_them():
    # The tree learned on the robot (personalrobots-pkg, gripper_realtime_closed_loop.py): delta_t over 0.542 s is
    # full and open; p_steady at or under 49.578 mm is empty and open. These two the catalogue was fitted to.
    delta_t, p_steady = {}, {}
    for state in ("full_open", "full_closed", "empty_open", "empty_closed"):
        drawn = [
            FEATURES.extract(grasp.trace) for grasp in peaks("hybrid", 23.0, f"odwalla:{state}", range(5))[0]
        ]
        delta_t[state], p_steady[state] = (
            np.median([d[name] for d in drawn]) for name in ("delta_t", "p_steady")
        )
    full, empty = delta_t.pop("full_open"), p_steady.pop("empty_open")
    assert full > 0.542 > max(delta_t.values())
    assert empty < 0.049578 < min(p_steady.values())
