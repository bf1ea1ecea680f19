"""The delay of the sensor: a lag of the force comes back, and does not bias what relaxes."""

import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from squeezes import delayed, grasped, recorded

from graspsense_identify import run
from graspsense_identify.delay import Delay
from graspsense_identify.prepare import prepared
from graspsense_identify.run import Timed, identify
from graspsense_identify.share import WHOLE
from graspsense_sim_gripper.config import SimConfig

SCENE = (
    'width_m = 0.05\nshare = 0.6\n[[terms]]\ntype = "elastic"\nk1_n_m = 1200.0\n'
    '[[terms]]\ntype = "maxwell"\nk_n_m = 500.0\ntau_s = 0.2\n'
)
GRIPPERS = ({"sensor": "ideal"}, {"sensor": "pads"}, {"sensor": "pads", "pad_delay_s": 0.01})
LATE_S = (0.0, 0.01, 0.025)
IN_CI = ((0, 0.0), (1, 0.025), (2, 0.01))
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
    # The forces, and the times of images, are late by a time that the settings do not contain.
    late = [delayed(squeeze, late_s) for squeeze in grasped([SCENE] * 3, gripper)]
    result = identify(SimConfig(), late, lambda *_: None)
    named = {parameter.name: parameter for parameter in result.parameters}
    delay, tau = named["delay_s"], named["maxwell.tau_s"]
    assert delay.value == pytest.approx(settings_s + late_s, abs=0.002)
    assert delay.high - delay.low < 0.01
    assert tau.value == pytest.approx(0.2, rel=0.06)
    chosen = [candidate.terms for candidate in result.candidates if candidate.chosen]
    assert chosen == ["elastic (k1) + maxwell"]
    used_s = tomllib.loads(result.scene)["identified"]["sensor"]["delay_s"]
    assert used_s == pytest.approx(settings_s + late_s, abs=0.002)
    assert delay.value == pytest.approx(used_s, rel=1e-5)
    if late_s == 0.0:
        assert used_s == settings_s


def delay_of(used_s, shown_s, error_s):
    interval = {"low_s": shown_s - error_s, "high_s": shown_s + error_s}
    return Delay(settings_s=0.0, used_s=used_s, shown_s=shown_s, **interval)


@every_case("shown_s", [-0.0011, 0.0, 0.0102, 0.03])
def test_the_delay_that_is_reported_is_the_one_that_is_used(shown_s):
    delay = delay_of(0.01, shown_s, 1e-3)
    (parameter,) = delay.parameters
    assert parameter.value == delay.used_s
    assert parameter.low <= min(shown_s, 0.01) <= max(shown_s, 0.01) <= parameter.high
    excluded = not delay.low_s <= 0.01 <= delay.high_s
    rather = any("recordings rather show" in open_.reason for open_ in delay.undetermined)
    assert (delay.error_s > 0.0, rather) == (excluded, excluded)


@every_case(
    ("found_s", "shown", "used_s"),
    [
        (0.0, lambda used_s: 0.0004, 0.0),
        (-0.0032, lambda used_s: -0.00111, 0.0),  # the chosen terms show -2.62 to 0.40 ms, and so none
        (0.0032, lambda used_s: 0.0051, 0.0051),  # they show another one, which is used
        (-0.0032, lambda used_s: -0.0051, -0.0051),
        (0.0102, lambda used_s: 0.0100, 0.0102),  # they show this one
        (0.0100, lambda used_s: used_s + 0.004, 0.0),  # they always show more
    ],
)
def test_a_delay_is_used_only_if_the_terms_that_are_chosen_with_it_show_it(
    monkeypatch, found_s, shown, used_s
):
    choice = SimpleNamespace(fitted=None)
    monkeypatch.setattr(run, "_timed", lambda *given: Timed(WHOLE, choice, [given[3]]))
    monkeypatch.setattr(run, "lag_of", lambda choice: found_s)
    monkeypatch.setattr(run, "delay_of", lambda fitted, _, lag_s: delay_of(lag_s, shown(lag_s), 0.00151))

    used, told = run._with_delay(SimConfig(), None, [], [], None)
    assert told.used_s == pytest.approx(used_s, abs=1e-9)
    # The choice is that which was made with the lag that is told.
    assert used.notes == [told.used_s]


@pytest.mark.slow
def test_a_ramp_at_one_speed_does_not_show_the_delay_and_says_so():
    ramp = recorded(hold_s=0.0)
    result = identify(SimConfig(sensor="ideal", pad_stiffness_n_m=float("inf")), [ramp], lambda *_: None)
    (refused,) = [open_ for open_ in result.undetermined if open_.what == "delay of the sensor"]
    assert "at one speed" in refused.reason
    assert "changing speed" in refused.remedy
    assert not [parameter for parameter in result.parameters if parameter.name == "delay_s"]


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
