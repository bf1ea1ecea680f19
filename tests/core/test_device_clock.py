"""The clock of a device against the host's: offset and drift from the fastest arrivals, and how far off they can be."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense.gripper_api import DeviceClock


def fed(clock, seconds, drift, offset_s, seed, rate_hz=200.0):
    """Let arrivals of this clock come with random delays, some of them long; return their ages and true delays."""
    rng = np.random.default_rng(seed)
    device_s = np.arange(0.0, seconds, 1.0 / rate_hz)
    delays_s = rng.exponential(0.002, device_s.size) + np.where(rng.random(device_s.size) < 0.02, 0.2, 0.0)
    host_s = device_s * (1.0 + drift) + offset_s + delays_s
    order = np.argsort(host_s)
    ages = [clock.age_s(float(device_s[i]), float(host_s[i])) for i in order]
    return np.array(ages), delays_s[order]


@settings(max_examples=20, deadline=None)
@given(drift=st.floats(-1e-4, 1e-4), offset_s=st.floats(-1e3, 1e3), seed=st.integers(0, 2**32 - 1))
def test_offset_and_drift_are_found_and_the_ages_are_the_delays(drift, offset_s, seed):
    clock = DeviceClock()
    ages, delays = fed(clock, 25.0, drift, offset_s, seed)
    line = clock.line()
    assert line.drift == pytest.approx(drift, abs=5e-6)
    true_s = offset_s + drift * line.at_s
    assert abs(line.offset_s - true_s) <= line.uncertainty_s + 1e-4
    assert line.uncertainty_s < 0.002
    assert line.host_s(line.at_s + 5.0) == pytest.approx(line.at_s + 5.0 + true_s + 5.0 * drift, abs=1e-3)
    assert np.abs(ages - delays)[1000:].max() < 1e-3
    assert clock.latency_s() == pytest.approx(0.002 * np.log(2.0), abs=5e-4)


def test_a_stall_of_the_host_moves_neither_offset_nor_drift():
    clock = DeviceClock()
    fed(clock, 10.0, 5e-5, 3.0, 1)
    line_before = clock.line()
    # For two seconds everything is half a second late, as after a stall with a full buffer.
    ages = [clock.age_s(t, t * (1.0 + 5e-5) + 3.5) for t in np.arange(10.0, 12.0, 0.005).tolist()]
    assert min(ages[1:]) > 0.49
    assert clock.line().drift == pytest.approx(line_before.drift, abs=5e-6)
    assert clock.line().host_s(12.0) == pytest.approx(line_before.host_s(12.0), abs=5e-4)
    assert clock.line().uncertainty_s > 0.4, "the late blocks are part of how far off it can be"


def test_before_anything_came_nothing_is_claimed():
    clock = DeviceClock()
    assert clock.line().uncertainty_s == np.inf
    assert np.isnan(clock.latency_s())
    assert clock.age_s(1.0, 101.0) == 0.0
    assert clock.line().offset_s == 100.0
    assert clock.line().uncertainty_s > 0.0
