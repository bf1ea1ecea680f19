"""The delay of the sensor: a lag of the force comes back, and does not bias what relaxes."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from attrs import evolve
from identify import delayed
from squeezes import recorded

from graspsense.core.components.identification import RecordedSqueeze
from graspsense.plugin_api import RunConfig, create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.identify.prepare import prepared
from graspsense_sim_gripper.identify.run import identify

SCENE = """width_m = 0.05
share = 0.6
[[terms]]
type = "elastic"
k1_n_m = 1200.0
[[terms]]
type = "maxwell"
k_n_m = 500.0
tau_s = 0.2
"""


def late_recordings(gripper, late_s, seeds=(1, 2, 3)):
    """Return recordings whose forces, and times of images, are late by a time that the settings do not contain."""
    backend, controller = create("sensor-backend", "sim", **gripper), create("controller", "hybrid")
    grasps = backend.run_many(
        controller, [SCENE] * len(seeds), list(seeds), run=RunConfig(hold_s=1.0), traces=True
    )
    return [
        delayed(RecordedSqueeze(name=str(seed), sha256="0" * 64, trace=grasp.trace, gripper=gripper), late_s)
        for seed, grasp in zip(seeds, grasps, strict=True)
    ]


GRIPPERS = ({"sensor": "ideal"}, {"sensor": "pads"}, {"sensor": "pads", "pad_delay_s": 0.01})
LATE_S = (0.0, 0.01, 0.025)
IN_CI = ((0, 0.025), (1, 0.0), (1, 0.025), (2, 0.01))
"""The place of a gripper, and a delay."""


@pytest.mark.parametrize(
    ("gripper", "late_s"),
    [
        pytest.param(gripper, late_s, marks=pytest.mark.slow if (i, late_s) in IN_CI else pytest.mark.long)
        for i, gripper in enumerate(GRIPPERS)
        for late_s in LATE_S
    ],
)
def test_a_known_delay_comes_back_and_does_not_bias_relaxation(gripper, late_s):
    settings_s = gripper.get("pad_delay_s", 0.0)
    found = identify(SimConfig(), late_recordings(gripper, late_s), lambda *_: None)
    named = {one.name: one for one in found.parameters}
    delay, tau = named["delay_s"], named["maxwell.tau_s"]
    assert delay.value == pytest.approx(settings_s + late_s, abs=0.002)
    assert delay.high - delay.low < 0.01
    assert tau.value == pytest.approx(0.2, rel=0.06)
    assert [one.terms for one in found.candidates if one.chosen] == ["elastic (k1) + maxwell"]
    used_s = tomllib.loads(found.scene)["identified"]["sensor"]["delay_s"]
    assert used_s == pytest.approx(settings_s + late_s, abs=0.002)
    if late_s == 0.0:
        assert used_s == settings_s


@pytest.mark.slow
def test_a_ramp_at_one_speed_does_not_show_the_delay_and_says_so():
    ramp = recorded(hold_s=0.0)
    found = identify(SimConfig(sensor="ideal", pad_stiffness_n_m=float("inf")), [ramp], lambda *_: None)
    (refused,) = [one for one in found.undetermined if one.what == "delay of the sensor"]
    assert "at one speed" in refused.reason
    assert "changing speed" in refused.remedy
    assert not [one for one in found.parameters if one.name == "delay_s"]


def test_an_image_has_its_own_force_whatever_the_settings_say_about_its_delay():
    squeeze = recorded(period_s=0.041)
    # Each image arrives 20 ms after it was taken.
    late = delayed(squeeze, 0.02)
    late = evolve(late, trace=evolve(late.trace, pad_t_s=squeeze.trace.pad_t_s))
    for delay_s in (0.0, 0.02):
        as_recorded, arrived_late = prepared(squeeze, 0.0), prepared(late, delay_s)
        n = len(arrived_late.force_n) - 1
        np.testing.assert_array_equal(as_recorded.force_n[:n], arrived_late.force_n[:n])


def test_a_force_without_a_time_of_its_own_is_as_late_as_the_settings_say():
    squeeze = recorded()
    late = delayed(squeeze, 0.02)
    for delay_s, lag_s in ((0.02, 0.0), (0.005, 0.015)):
        path = prepared(late, delay_s, lag_s=lag_s)
        loading = path.gap_m[path.sample] > 0.05 - 0.9 * 0.008
        closure = np.maximum(0.05 - path.gap_m[path.sample][loading], 0.0)
        assert np.abs(path.force_n[loading] - 1000.0 * closure).max() < 0.1
