"""How far the times of two channels can be apart, from what the devices tell of their clocks."""

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_device_clock import fed

from graspsense import load_pipeline
from graspsense.core.drivers.device_clock import DeviceClock, clock_report
from graspsense.core.values.errors import UnknownName
from graspsense.core.values.trial import apart_s

PADS = ("force_left", "force_right", "pads")


@settings(max_examples=15, deadline=None)
@given(st.floats(-1e-4, 1e-4), st.floats(-1e-4, 1e-4), st.integers(0, 10_000))
def test_two_clocks_are_not_further_apart_than_is_said(leading, trailing, seed):
    """Two fingertips with clocks of their own, with delays that nobody knows: both err, and the sum bounds it."""
    report, errors = {}, []
    for name, drift in (("left", leading), ("right", trailing)):
        clock = DeviceClock()
        ages, delays = fed(clock, 15.0, drift, 5.0, seed, rate_hz=50.0)
        report |= clock_report(name, clock, (f"cells_{name}",))
        # What came in the first second is corrected by nobody.
        errors.append(np.abs(ages - delays)[-250:].max())
    trace = SimpleNamespace(pad_t_s=np.empty(0), t_s=np.arange(2.0))
    apart = apart_s(trace, report, "cells_left", "cells_right")
    assert 0.0 < apart < 0.01
    assert sum(errors) <= apart + 5e-4


def test_one_device_is_measured_at_once_and_an_unknown_clock_promises_nothing():
    trace = SimpleNamespace(pad_t_s=np.array([0.0, 0.02, 0.05]), t_s=np.array([0.0, 0.06]))
    trace.force_left_n = trace.force_right_n = np.array([1.0, 1.0, 2.0, 2.0, 3.0])
    clock = DeviceClock()
    fed(clock, 15.0, 0.0, 0.0, 1)
    report = clock_report("tactile", clock, PADS)
    sure = clock.line().uncertainty_s
    assert apart_s(trace, report, "gap", "effort") == 0.0
    assert apart_s(trace, report, "gap", "pads") == inf
    report["frame_uncertainty_s"] = 0.004
    assert apart_s(trace, report, "gap", "pads") == pytest.approx(0.004 + sure)
    # The force of a frame is that of the last image, which is up to 30 ms old.
    assert apart_s(trace, report, "force_left", "gap") == pytest.approx(0.004 + sure + 0.03)
    assert apart_s(trace, report, "force_left", "force_right") == 0.0
    assert apart_s(trace, report, "force_left", "pads") == pytest.approx(0.03)
    # One that changes in each frame does not come from the images, which are fewer.
    trace.force_right_n = np.arange(5.0)
    assert apart_s(trace, report, "force_right", "gap") == pytest.approx(0.004 + sure)
    assert apart_s(trace, {}, "force_left", "gap") == pytest.approx(0.03), "one device"


def test_a_trial_tells_it_and_names_its_channels():
    trial = load_pipeline("default").grasp()
    assert trial.apart_s("gap", "effort") == 0.0
    with pytest.raises(UnknownName, match="gap"):
        trial.apart_s("gap", "gape")
