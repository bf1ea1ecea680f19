"""Quantiles of gap and forces over the contact: known curves, uneven samples, units, grasps without contact."""

import numpy as np
import pytest
from traces import made_trace

from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import SI_UNITS
from graspsense.plugin_api import create
from graspsense.testing.samples import squeeze

CONTACT_N = 0.625
EVEN = np.arange(0.0, 0.9, 0.001)


def extract(trace, **settings):
    return create("feature-set", "graspsense/quantiles", **settings).extract(trace)


def spring(t_s=EVEN, units=SI_UNITS):
    """A spring is squeezed by 4 mm in 0.4 s and released in 0.4 s, at constant speed; the right pad feels 0.9 of it.

    The fingers are open from 0.8 s on.
    """
    x = np.interp(t_s, [0.0, 0.4, 0.8], [0.0, 0.004, 0.0])
    gap = 0.060 - x + np.maximum(t_s - 0.8, 0.0) * 0.01
    phase = np.where(t_s < 0.4, Phase.SQUEEZE, Phase.RELEASE)
    return made_trace(np.column_stack((gap, 4000.0 * x, 3600.0 * x)), phases=phase, units=units, t_s=t_s)


def test_a_spring_that_is_squeezed_and_released_at_constant_speed():
    f = extract(spring())
    touch_m = CONTACT_N / 3600.0  # of the pad with the smaller force
    assert not f.reasons
    expected = {
        "contact_gap": pytest.approx(0.060 - touch_m, abs=1e-6),
        "contact_time": pytest.approx(0.8 - 2.0 * touch_m / 0.01, abs=1e-3),
        "gap_whole_min": pytest.approx(0.056, abs=5e-5),
        "gap_whole_max": pytest.approx(0.060 - touch_m, abs=1e-6),
        "gap_whole_median": pytest.approx(0.058 - touch_m / 2.0, abs=5e-5),
        "high_force_second_max": pytest.approx(16.0, rel=0.02),
        "low_force_first_min": pytest.approx(CONTACT_N, abs=1e-3),
        "gap_rate_first_median": pytest.approx(-0.01, rel=1e-3),
        "gap_rate_second_median": pytest.approx(0.01, rel=1e-3),
        "low_force_rate_first_median": pytest.approx(36.0, rel=1e-3),
    }
    assert {name: f[name] for name in expected} == expected
    units = dict(zip(f.names, extract(spring(units={**SI_UNITS, "t": "frames"})).units, strict=True))
    assert (units["contact_time"], units["gap_rate_whole_max"]) == ("frames", "m/frames")


def test_which_samples_a_recording_has_and_how_long_it_goes_on_does_not_count():
    expected = extract(spring()).values
    chosen = np.random.default_rng(1).uniform(size=len(EVEN)) < 0.5
    chosen[[0, 400, 800]] = True
    assert extract(spring(EVEN[chosen])).values == pytest.approx(expected, rel=0.02, abs=0.02)
    later = np.concatenate((EVEN, [1.0, 5.0]))
    assert extract(spring(later)).values == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_a_grasp_without_contact_or_with_too_few_samples_has_none_with_the_reason():
    f = extract(squeeze(contacts=(-1.0, -1.0)))
    assert set(f.reasons) == set(f.names)
    assert "never felt 0.625 N" in f.reasons["gap_whole_median"]
    few = extract(spring().until(0.0185))
    assert "three samples" in few.reasons["gap_whole_median"]
    assert few["contact_gap"] == pytest.approx(0.060 - CONTACT_N / 3600.0, abs=1e-6)
