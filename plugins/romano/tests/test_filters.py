"""The filters against scipy's designs and the printed coefficients of pr2_gripper_sensor (2010)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense_romano.filters import NOT_BEGUN, RIPPLE_DB, band_pass, band_passed, low_pass
from graspsense_romano.signals import FILTERS


def printed(value, digits=4):
    return f"{value:.{digits}f}"


def test_the_published_coefficients_to_their_printed_digits():
    pads, palm = FILTERS.low, FILTERS.acceleration
    assert [printed(x) for x in pads] == ["0.6323", "-0.6294", "-0.2647"]  # pressure_observer.cpp
    # acceleration_observer.cpp prints a2 as -0.6610: -0.66096.
    assert [printed(x) for x in palm] == ["0.8305", "-0.3329", "-0.6610"]
    assert [printed(x) for x in low_pass(1000.0, 1.0 / 3000.0)] == ["0.6340", "0.2679"]
    # 1 / (1 + 2 pi 5 Hz 0.041 s), pressure_observer.cpp
    assert FILTERS.high == pytest.approx(0.437, abs=5e-4)


@pytest.mark.slow
@given(st.floats(0.1, 50.0), st.floats(1.2, 100.0), st.floats(2.1, 100.0))
@settings(max_examples=30)
def test_the_band_pass_is_scipys_chebyshev(low_hz, ratio, oversampling):
    import scipy

    high_hz = low_hz * ratio
    rate_hz = high_hz * oversampling
    b, a = scipy.signal.cheby1(1, RIPPLE_DB, [low_hz, high_hz], "bandpass", fs=rate_hz)
    ours = band_pass(low_hz, high_hz, 1.0 / rate_hz)
    assert [ours.b, 0.0, -ours.b, 1.0, ours.a1, ours.a2] == pytest.approx([*b, *a], abs=1e-9)


@pytest.mark.slow
@given(st.floats(0.1, 100.0), st.floats(2.1, 100.0))
@settings(max_examples=30)
def test_the_low_pass_is_scipys_butterworth(cutoff_hz, oversampling):
    import scipy

    rate_hz = cutoff_hz * oversampling
    b, a = scipy.signal.butter(1, cutoff_hz, fs=rate_hz)
    ours_b, ours_a = low_pass(cutoff_hz, 1.0 / rate_hz)
    assert [ours_b, ours_b, 1.0, ours_a] == pytest.approx([*b, *a], abs=1e-9)


@pytest.mark.slow
def test_a_filtered_signal_is_that_of_scipy():
    import scipy

    band = band_pass(0.8, 5.0, 0.041)
    x = np.random.default_rng(0).standard_normal(200)
    x[0] = 0.0  # a filter of scipy begins at zero
    state, ours = NOT_BEGUN, []
    for value in x:
        state = band_passed(band, state, float(value))
        ours.append(state.y1)
    expected = scipy.signal.lfilter([band.b, 0.0, -band.b], [1.0, band.a1, band.a2], x)
    assert np.allclose(ours, expected, atol=1e-12)


@given(st.floats(-100.0, 100.0))
def test_a_constant_gives_no_transient(constant):
    """The published controller begins at zero, so that gravity itself was a shock."""
    state = NOT_BEGUN
    for _ in range(50):
        state = band_passed(FILTERS.acceleration, state, constant)
        assert state.y1 == 0.0


def test_a_band_that_the_samples_cannot_carry_is_refused():
    with pytest.raises(ValueError, match="samples a second"):
        band_pass(5.0, 1000.0, 1.0 / 2000.0)
