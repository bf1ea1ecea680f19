"""First contact and rest: the two instants every feature hangs on."""

from math import nan

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.control.contact import (
    REST_SPEED_M_S,
    REST_WINDOW_S,
    RestCourse,
    RestState,
    at_rest,
    both_touch,
    first_rest,
    follow_rest,
    update_rest,
)


def test_contact_needs_both_pads_at_or_over_the_threshold():
    # Equation 1 as the text means it: one finger first is no contact, exactly tau_1 is.
    assert all(both_touch(*forces, 0.625) for forces in ((0.625, 0.7), (0.7, 0.625)))
    assert not any(both_touch(*forces, 0.625) for forces in ((5.0, 0.6249), (0.0, 5.0), (nan, 5.0)))


def still_after(gaps, dt=0.001):
    still = RestState(0.0, gaps[0])
    for k, gap in enumerate(gaps):
        still = update_rest(still, k * dt, gap, REST_SPEED_M_S, REST_WINDOW_S)
    return still, (len(gaps) - 1) * dt


def test_one_encoder_tick_does_not_end_the_stillness():
    # 0.33 um in 1 ms is 0.33 mm/s, over tau_2: a test of single samples would never see rest.
    still, now = still_after([0.05] * 20 + [0.05 + 0.33e-6] * 31)
    assert still.since_t_s == 0.0
    assert at_rest(still, now, REST_WINDOW_S)


@pytest.mark.parametrize(("speed_m_s", "ticks", "rests"), [(1.2e-4, 2000, False), (0.8e-4, 51, True)])
def test_a_gap_that_creeps_is_at_rest_if_it_is_slower_than_tau_2(speed_m_s, ticks, rests):
    still, now = still_after([0.05 - speed_m_s * 0.001 * k for k in range(ticks)])
    assert at_rest(still, now, REST_WINDOW_S) == rests


def test_fifty_ticks_of_a_millisecond_fill_the_window_despite_rounding():
    still = RestState(3 * 0.001, 0.05)
    assert at_rest(still, 53 * 0.001, REST_WINDOW_S)
    assert not at_rest(still, 52 * 0.001, REST_WINDOW_S)


def test_a_gap_that_is_no_number_is_never_still():
    still = update_rest(RestState(0.0, 0.05), 0.001, nan, REST_SPEED_M_S, REST_WINDOW_S)
    again = update_rest(still, 0.1, nan, REST_SPEED_M_S, REST_WINDOW_S)
    assert not at_rest(again, 0.1, REST_WINDOW_S)


def test_on_a_clock_slower_than_the_window_the_bound_grows_with_the_time_elapsed():
    still = RestState(0.0, 0.05)
    assert update_rest(still, 1.0, 0.05 - 0.9e-4, REST_SPEED_M_S, REST_WINDOW_S) is still
    assert update_rest(still, 1.0, 0.05 - 1.1e-4, REST_SPEED_M_S, REST_WINDOW_S) is not still


@given(st.lists(st.floats(-1e-3, 1e-3), min_size=60, max_size=200))
def test_at_rest_means_the_gap_stayed_within_bounds_over_the_whole_window(steps):
    gap, t = 0.05, 0.0
    still, seen = RestState(t, gap), [(t, gap)]
    for step in steps:
        t, gap = t + 0.001, gap + step * 0.01
        seen.append((t, gap))
        still = update_rest(still, t, gap, REST_SPEED_M_S, REST_WINDOW_S)
        if at_rest(still, t, REST_WINDOW_S):
            within = [g for when, g in seen if when >= still.since_t_s]
            assert max(abs(g - within[0]) for g in within) <= REST_SPEED_M_S * (t - still.since_t_s) + 1e-15


@given(st.lists(st.floats(0.0, 2e-5), min_size=60, max_size=200), st.floats(1e-3, 0.02))
def test_a_gap_that_closes_without_noise_rests_the_same_in_a_recording(steps, dt_s):
    gap = 0.05
    still, course = RestState(0.0, gap), RestCourse(0.0, gap, nan, nan, nan)
    for k, step in enumerate(steps, 1):
        gap -= step
        still = update_rest(still, k * dt_s, gap, REST_SPEED_M_S, REST_WINDOW_S)
        course = follow_rest(course, k * dt_s, gap, REST_SPEED_M_S, REST_WINDOW_S)
        assert (course.since_t_s, course.gap_m) == (still.since_t_s, still.gap_m)


@every_case(
    ("rate_hz", "noise_m", "window_s"), [(50.0, 8e-6, 0.32), (250.0, 8e-6, 0.32), (1000.0, 20e-6, 0.8)]
)
def test_noise_does_not_begin_a_rest_anew(rate_hz, noise_m, window_s):
    """A rest in whose noise one sample in 30 000 is further from the middle than the gap may move."""
    late, rng = [], np.random.default_rng(1)
    for _ in range(40):
        times = np.arange(0.0, 2.5, 1.0 / rate_hz)
        gaps = np.interp(times, [0.0, 0.5], [0.065, 0.06]) + noise_m * rng.normal(size=len(times))
        resting = first_rest(times, gaps, np.ones(len(times), bool), REST_SPEED_M_S, window_s)
        late.append(times[resting[0]] - 0.5 if resting else 2.5)
    assert np.mean(np.abs(late) < 0.1) > 0.9
