"""Quantiles on intervals of the whole recording: known curves, grasps without contact, missing channels, many names."""

import math

import numpy as np
import pytest
from attrs import evolve
from traces import made_trace

from graspsense.core.values.features import SHOWN
from graspsense.core.values.signals import NO_GAP, Phase
from graspsense.core.values.trace import SI_UNITS
from graspsense.plugin_api import create
from graspsense.testing.samples import squeeze


def extract(trace):
    return create("feature-set", "quant").extract(trace)


def made(t_s, gap, left, right):
    return made_trace(np.column_stack((gap, left, right)), phase=Phase.APPROACH, t_s=t_s)


def ramp():
    """Fingers that close at 10 mm/s for 2 s and touch nothing; the pads have an offset, the left one a ripple."""
    since = np.linspace(0.0, 2.0, 201)
    left = 0.1 + 0.05 * np.sin(2.0 * np.pi * 8.0 * since)
    return made(5.0 + since, 0.080 - 0.010 * since, left, np.full(len(since), 0.04))


def test_a_straight_course_without_contact_has_its_values_and_rates():
    f = extract(ramp())
    assert not f.reasons
    values = {
        "duration": 2.0,
        "gap_value_1of1_q1of32": 0.060,
        "gap_value_1of1_q31of32": 0.060 + 0.020 * 30.0 / 31.0,
        # Every second quantile is less the mean: the largest of 32 is.
        "gap_value_1of1_q32of32": 0.080 - 0.070,
        # The second of four parts has the points 32 to 63 of 0 to 127.
        "gap_value_2of4_q1of8": 0.080 - 0.020 * 63.0 / 127.0,
        "gap_rate_8of16_q1of2": -0.010,
        "gap_rate2_8of16_q1of2": 0.0,
        "low_force_value_1of1_q1of32": 0.04,
    }
    assert {name: f[name] for name in values} == pytest.approx(values, abs=1e-9)
    # 16 periods of the ripple: about the 16th of 65 frequencies, which is in the eighth of 32 parts.
    spectrum = [f[f"high_force_fourier_{k}of32_q1of1"] for k in range(2, 33)]
    assert 2 + int(np.argmax(spectrum)) in (8, 9)


def test_the_quantiles_are_those_of_numpy():
    values = np.random.default_rng(2).normal(size=128)
    f = extract(made(np.arange(128.0), values, values, values))
    part = values[64:96]
    expected = np.quantile(part, np.linspace(0.0, 1.0, 8))
    expected[1::2] -= part.mean()
    assert [f[f"gap_value_3of4_q{k}of8"] for k in range(1, 9)] == pytest.approx(expected.tolist())
    assert f["gap_value_2of4shifted_q1of8"] == pytest.approx(values[48:80].min())


def test_a_recording_without_gap_has_the_features_of_the_forces():
    f = extract(evolve(ramp(), units={**SI_UNITS, "gap": NO_GAP}))
    gaps = {name for name in f.names if name.startswith("gap_")}
    assert f.reasons == dict.fromkeys(gaps, "no gap was recorded")


def test_single_samples_that_are_lost_change_little():
    whole = ramp()
    gap = whole.gap_m.copy()
    gap[[0, 50, 51, 200]] = math.nan
    lost = extract(evolve(whole, gap_m=gap))
    assert lost["gap_value_2of4_q1of8"] == pytest.approx(extract(whole)["gap_value_2of4_q1of8"])
    assert not lost.reasons


def test_two_samples_have_no_features_and_say_why():
    f = extract(ramp().until(5.015))
    assert set(f.reasons) == set(f.names)
    assert "three samples" in f.reasons["duration"]


def test_people_are_shown_some_features_and_the_number_of_the_others():
    f = extract(squeeze())
    rows, more = f.shown()
    assert len(rows) == SHOWN
    assert more == f"{len(f.names) - SHOWN} more features"
    assert more in repr(f)
    assert more in f._repr_html_()
