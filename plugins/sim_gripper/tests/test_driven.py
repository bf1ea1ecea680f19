"""Squeezes along a recorded gap or force: against closed forms, against grasps, and back."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases import every_case

from graspsense.plugin_api import create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.driven import RecordedPath, follow_many

SHELL = """width_m = 0.06
[[terms]]
type = "elastic"
k1_n_m = 4000.0
k3_n_m3 = -1e8
"""
ARM = """[[terms]]
type = "maxwell"
k_n_m = 2000.0
tau_s = 0.3
"""
BREAKS = """[[terms]]
type = "fracture"
force_n = 6.0
left = 0.25
"""
NOMINAL = {"spread": False, "sensor": "ideal", "compile": "never"}
T_S = np.arange(0.0, 1.5, 0.0123)
GAP_M = 0.0605 - 0.003 * np.clip(T_S, 0.0, 1.0)


def squeezed(scene, path, **settings):
    return follow_many(SimConfig(**{**NOMINAL, **settings}), path, [scene], [0])[0]


def test_a_shell_behind_rigid_fingers_has_the_force_of_its_law():
    done = squeezed(SHELL, RecordedPath(t_s=T_S, gap_m=GAP_M), pad_stiffness_n_m=math.inf)
    d = np.maximum(0.06 - GAP_M, 0.0)
    np.testing.assert_allclose(done.force_n, 4000.0 * d - 1e8 * d**3, atol=1e-9)
    np.testing.assert_allclose(done.compression_m, d, atol=1e-12)
    assert done.resolved


def test_pads_give_way_in_series():
    done = squeezed(SHELL, RecordedPath(t_s=T_S, gap_m=GAP_M), pad_stiffness_n_m=2e4)
    closure = np.maximum(0.06 - GAP_M, 0.0)
    # Two pads in series have half the stiffness of one.
    np.testing.assert_allclose(done.force_n, 1e4 * (closure - done.compression_m), atol=1e-8)


def test_a_relaxing_arm_keeps_its_decay_while_the_gap_rests():
    scene = SHELL.replace("k3_n_m3 = -1e8\n", "") + ARM
    done = squeezed(scene, RecordedPath(t_s=T_S, gap_m=GAP_M), pad_stiffness_n_m=math.inf)
    rests = T_S > 1.05
    arm = done.force_n[rests] - 4000.0 * done.compression_m[rests]
    np.testing.assert_allclose(np.diff(np.log(arm)) / np.diff(T_S[rests]), -1.0 / 0.3, rtol=1e-9)


def test_a_break_is_located_between_the_samples():
    done = squeezed(SHELL + BREAKS, RecordedPath(t_s=T_S, gap_m=GAP_M))
    assert done.broken
    assert done.resolved
    assert done.peak_n == pytest.approx(6.0, rel=1e-6)
    assert done.force_n.max() < 6.0


def test_a_recorded_force_gives_the_gap_that_it_came_from():
    along_gap = squeezed(SHELL + ARM, RecordedPath(t_s=T_S, gap_m=GAP_M))
    back = squeezed(SHELL + ARM, RecordedPath(t_s=T_S, force_n=along_gap.force_n), step_s=0.1)
    again = squeezed(SHELL + ARM, RecordedPath(t_s=T_S, gap_m=GAP_M), step_s=0.1)
    assert back.resolved
    np.testing.assert_allclose(back.force_n, along_gap.force_n, atol=1e-6)
    pressed = again.force_n > 0.1
    np.testing.assert_allclose(back.gap_m[pressed], GAP_M[pressed], atol=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sponge", "leaking_bottle"])
def test_a_grasp_has_its_own_forces_along_its_own_gap(name):
    gripper = create("sensor-backend", "sim", fidelity="reference", **NOMINAL)
    grasp = gripper.run_many(create("controller", "hybrid"), [name], [0], traces=True)[0]
    trace = grasp.trace
    done = squeezed(name, RecordedPath(t_s=trace.t_s, gap_m=trace.gap_m))
    closing = trace.phase <= 2
    force = 0.5 * (trace.force_left_n + trace.force_right_n)
    # The gap between two ticks is a parabola in the grasp, and a line here.
    np.testing.assert_allclose(done.force_n[closing], force[closing], atol=2e-3 * force.max())


@pytest.mark.slow  # It compiles.
def test_compiled_and_plain_are_equal():
    paths = (
        RecordedPath(t_s=T_S, gap_m=GAP_M),
        RecordedPath(t_s=T_S, force_n=4.0 * np.sin(2.0 * T_S) ** 2),
    )
    for path in paths:
        plain, compiled = (squeezed(SHELL + ARM + BREAKS, path, compile=how) for how in ("never", "always"))
        np.testing.assert_allclose(compiled.force_n, plain.force_n, atol=1e-9)
        np.testing.assert_allclose(compiled.gap_m, plain.gap_m, atol=1e-11)


@every_case(
    ("values", "says"),
    [
        ({"t_s": [0, 1]}, "either gap_m or force_n"),
        ({"t_s": [0, 1], "gap_m": [0.06, 0.05], "force_n": [0, 1]}, "either gap_m or force_n"),
        ({"t_s": [0, 1, 2], "gap_m": [0.06, 0.05]}, "two arrays of one length"),
        ({"t_s": [0, 0], "gap_m": [0.06, 0.05]}, "must increase"),
        ({"t_s": [0, 1], "gap_m": [0.06, math.nan]}, "not finite"),
    ],
)
def test_a_path_that_makes_no_sense_is_refused(values, says):
    with pytest.raises(ValueError, match=says):
        RecordedPath(**values)
