"""How much recorded squeezes differ among themselves."""

import math

import numpy as np
import pytest

from graspsense.core.components.identification import SqueezeFit, repeatability


def squeeze(stiffness_n_m, depth_m, hysteresis=0.8):
    """A spring that is loaded to a depth and released along a softer branch."""
    loaded = np.linspace(0.0, depth_m, 40)
    compression = np.concatenate((loaded, loaded[::-1]))
    force = stiffness_n_m * np.concatenate((loaded, hysteresis * loaded[::-1]))
    given = {"t_s": np.arange(80.0), "compression_m": compression, "measured_n": force, "fitted_n": force}
    return SqueezeFit(name="spring", **given, rms_n=0.0, peak_n=float(force.max()))


def test_squeezes_are_compared_at_equal_compression_while_they_are_loaded():
    # Springs of 1000 and 1200 N/m differ by 200 N/m: a standard deviation of 141 N/m times the compression.
    fits = [squeeze(1000.0, 0.01), squeeze(1200.0, 0.02, hysteresis=0.1)]
    compression_m = np.linspace(0.001, 0.01, 20)
    expected = 200.0 / math.sqrt(2.0) * math.sqrt(np.mean(compression_m**2)) / 17.0
    assert repeatability(fits) == pytest.approx(expected, rel=1e-9)


def test_equal_squeezes_do_not_differ_and_a_single_one_says_nothing():
    assert repeatability([squeeze(1000.0, 0.01)] * 3) == pytest.approx(0.0, abs=1e-12)
    assert math.isnan(repeatability([squeeze(1000.0, 0.01)]))
