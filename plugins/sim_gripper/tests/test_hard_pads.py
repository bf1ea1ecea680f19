"""Nonlinear fingertips: their law, in series with an object, in grasps of every kind."""

import math

import numpy as np
import pytest

from graspsense.plugin_api import create
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.pads import PadCompliance, pad_compression
from graspsense_sim_gripper.run.compiled.compose import all_active, contact_solver, uncompressed
from graspsense_sim_gripper.scene.terms.elastic import Elastic

SPRING = 'width_m = 0.06\n[[terms]]\ntype = "elastic"\nk1_n_m = 4000.0\n'
PADS = {"pad_stiffness_n_m": 2e4, "pad_hardening_m": 4e-4}


def pressed(pads, stiffness_n_m):
    """Return the states of an object of this stiffness behind these fingertips, at growing closures."""
    model = ObjectModel(0.06, 0.0, pads, all_active([Elastic(stiffness_n_m, 0.0)]))
    solve, state = contact_solver(("elastic",)), uncompressed(["elastic"])
    states = []
    for closure in np.linspace(1e-5, 1.3e-3, 60):
        state, unbalanced = solve(model, state, closure, 0.0015, 0.017)
        assert unbalanced == 0
        states.append((closure, state))
    return states


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_pads_on_a_rigid_object_have_the_force_of_their_law(exponent):
    # Two pads in series: half the stiffness of one at twice its compression.
    pads = PadCompliance(1e4, hardening_m=8e-4, exponent=exponent)
    for closure, state in pressed(pads, 1e9):
        u = 0.5 * (closure - state.compression_m)
        assert state.force_n == pytest.approx(2e4 * u * (1.0 + (u / 4e-4) ** exponent), abs=1e-6)
        assert 2.0 * u == pytest.approx(pad_compression(pads, state.force_n), rel=1e-6)


def test_pads_that_harden_from_afar_are_linear():
    linear, hard = (
        pressed(PadCompliance(1e4, hardening_m=hardening_m), 4000.0) for hardening_m in (math.inf, 2e3)
    )
    forces = [[state.force_n for _, state in states] for states in (linear, hard)]
    np.testing.assert_allclose(forces[1], forces[0], atol=1e-8)
    assert forces[0][-1] == pytest.approx(1.3e-3 / (1 / 1e4 + 1 / 4000.0), rel=1e-6)


@pytest.mark.slow
def test_a_grasp_with_hard_pads_has_the_accuracy_that_is_asked_for_and_is_the_same_compiled():
    forces = []
    for settings in ({}, {"compile": "always"}, {"fidelity": "reference"}):
        chosen = {"sensor": "ideal", "spread": False, "compile": "never", **PADS, **settings}
        gripper = create("sensor-backend", "sim", **chosen)
        done = gripper.run_many(create("controller", "hybrid"), [SPRING], [0], traces=True)[0]
        assert done.report["resolved"]
        forces.append(done.trace.force_left_n)
    plain, compiled, reference = forces
    np.testing.assert_allclose(compiled, plain, atol=1e-9)
    n = min(len(plain), len(reference))
    assert np.sqrt(np.mean((plain[:n] - reference[:n]) ** 2) / np.mean(reference[:n] ** 2)) < 0.01
