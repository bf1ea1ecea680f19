"""Nonlinear fingertips: their law, in series with an object, in grasps of every kind."""

from __future__ import annotations

import numpy as np
import pytest

from graspsense.plugin_api import create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.pads import PadCompliance, pad_compression
from graspsense_sim_gripper.run.driven import RecordedPath, follow_many

STIFF = """width_m = 0.06
[[terms]]
type = "elastic"
k1_n_m = 1e9
"""
SPRING = STIFF.replace("1e9", "4000.0")
PADS = {"pad_stiffness_n_m": 2e4, "pad_hardening_m": 4e-4}
T_S = np.linspace(0.0, 1.0, 60)
PATH = RecordedPath(t_s=T_S, gap_m=0.0602 - 0.0015 * T_S)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_pads_on_a_rigid_object_have_the_force_of_their_law(exponent):
    config = SimConfig(spread=False, sensor="ideal", pad_exponent=exponent, **PADS)
    done = follow_many(config, PATH, [STIFF], [0])[0]
    u = 0.5 * np.maximum(0.06 - PATH.values - done.compression_m, 0.0)
    np.testing.assert_allclose(done.force_n, 2e4 * u * (1.0 + (u / 4e-4) ** exponent), atol=1e-6)
    assert done.resolved
    pads = PadCompliance(1e4, hardening_m=8e-4, exponent=exponent)
    assert 2.0 * u[-1] == pytest.approx(pad_compression(pads, done.force_n[-1]), rel=1e-9)


def test_pads_that_harden_from_afar_are_linear():
    config = SimConfig(spread=False, sensor="ideal", compile="never", pad_stiffness_n_m=2e4)
    linear = follow_many(config, PATH, [SPRING], [0])[0]
    config = SimConfig(spread=False, sensor="ideal", pad_stiffness_n_m=2e4, pad_hardening_m=1e3)
    np.testing.assert_allclose(follow_many(config, PATH, [SPRING], [0])[0].force_n, linear.force_n, atol=1e-8)


@pytest.mark.slow
def test_a_grasp_with_hard_pads_has_the_accuracy_that_is_asked_for():
    forces = []
    for settings in ({}, {"fidelity": "reference"}):
        gripper = create(
            "sensor-backend", "sim", sensor="ideal", spread=False, compile="never", **PADS, **settings
        )
        done = gripper.run_many(create("controller", "hybrid"), [SPRING], [0], traces=True)[0]
        assert done.report["resolved"]
        forces.append(done.trace.force_left_n)
    n = min(map(len, forces))
    assert np.sqrt(np.mean((forces[0][:n] - forces[1][:n]) ** 2) / np.mean(forces[1][:n] ** 2)) < 0.01


@pytest.mark.slow  # It compiles.
def test_compiled_and_plain_squeezes_are_equal():
    plain, compiled = (
        follow_many(SimConfig(spread=False, sensor="ideal", compile=how, **PADS), PATH, [SPRING], [0])[0]
        for how in ("never", "always")
    )
    np.testing.assert_allclose(compiled.force_n, plain.force_n, atol=1e-9)
