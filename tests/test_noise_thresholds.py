"""The thresholds that an import chooses where the defaults do not fit the noise of its recordings."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest
from attrs import evolve

from graspsense.core.control.contact import REST_SPEED_M_S, REST_WINDOW_S, first_rest
from graspsense.core.values.signals import NO_PADS, Frame, Reading
from graspsense.recording.replayable import Recording
from graspsense.sources.noise_thresholds import thresholds_for


def squeeze(peak_n=8.0, force_noise_n=0.01, gap_noise_m=0.0, step_s=0.001, seed=0, **more):
    """A gap that closes for a second until the force rises for half a second, then rests for half a second."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, 2.0, step_s)
    gap = np.interp(times, [0.0, 1.0, 1.5], [0.08, 0.06, 0.055]) + gap_noise_m * rng.normal(size=len(times))
    force = np.interp(times, [0.0, 1.0, 1.5], [0.0, 0.0, peak_n])
    pads = force[:, np.newaxis] + force_noise_n * rng.normal(size=(len(times), 2))
    return Recording(
        name="squeeze",
        rate_hz=1.0 / step_s,
        readings=tuple(
            Reading(Frame(t, step_s, g, 0.0, nan, left, right, nan, nan, 0), NO_PADS)
            for t, g, (left, right) in zip(times.tolist(), gap.tolist(), pads.tolist(), strict=True)
        ),
        **more,
    )


def test_defaults_that_fit_are_kept_and_said():
    chosen = thresholds_for([squeeze(seed=k) for k in range(5)])
    assert chosen.settings == {}
    assert "the defaults, which fit the noise" in chosen.words


def test_weak_forces_get_a_contact_threshold_above_their_noise_and_below_their_peak():
    """A hand whose fingers feel 0.5 N at most never touches by the default of 0.625 N."""
    chosen = thresholds_for([squeeze(peak_n=0.5, seed=k) for k in range(5)])
    force = chosen.settings["controller.contact_force_n"]
    assert 4 * 0.01 < force < 0.25
    assert f"contact_force_n {force:g} N" in chosen.words
    assert "default 0.625 N" in chosen.words


def test_noisy_forces_get_a_contact_threshold_that_noise_does_not_reach():
    recordings = [squeeze(peak_n=40.0, force_noise_n=0.5, seed=k) for k in range(5)]
    force = thresholds_for(recordings).settings["controller.contact_force_n"]
    free = [reading.frame.force_left_n for one in recordings for reading in one.readings[:1000]]
    assert max(free) < force < 20.0


@pytest.mark.parametrize(("gap_noise_m", "step_s"), [(2e-5, 0.001), (2e-5, 0.05)], ids=["noise", "slow"])
def test_rest_is_within_the_noise_and_several_samples(gap_noise_m, step_s):
    chosen = thresholds_for([squeeze(gap_noise_m=gap_noise_m, step_s=step_s, seed=k) for k in range(5)])
    speed, window = (chosen.settings[f"controller.{key}"] for key in ("rest_speed_m_s", "rest_window_s"))
    assert speed * window >= 4 * gap_noise_m
    assert window >= 5 * step_s
    # Closing at 0.01 to 0.02 m/s is not rest.
    assert speed < 0.005


def test_recordings_that_begin_close_to_the_object_are_not_too_wide():
    whole = squeeze()
    close = evolve(whole, readings=whole.readings[980:])
    assert thresholds_for([whole]).settings == {}
    chosen = thresholds_for([whole, close])
    assert chosen.settings == {"controller.too_wide_m": 0.0}
    assert "1 of 2 recordings touch within 1 mm of their beginning" in chosen.words


def test_a_force_that_grows_from_the_first_sample_is_not_taken_for_noise():
    """Recordings that begin in contact: the first third of a slow squeeze up to 25 N reaches 1.6 N."""
    whole = [squeeze(peak_n=25.0, seed=k) for k in range(5)]
    squeezed = [evolve(one, readings=one.readings[1000:]) for one in whole]
    assert "controller.contact_force_n" not in thresholds_for(squeezed).settings


def test_forces_that_are_no_more_than_noise_are_doubted():
    chosen = thresholds_for([squeeze(peak_n=0.0, force_noise_n=1.0, seed=k) for k in range(3)])
    assert "check the unit and the zero" in chosen.words


def test_recordings_in_other_units_keep_the_defaults():
    assert thresholds_for([squeeze(peak_n=0.5, units={"gap": "deg"})]).settings == {}


def test_slow_recordings_whose_gap_is_still_at_rest_keep_the_thresholds_of_rest():
    """Coarse steps while the fingers move are not noise: with these thresholds rest is where the gap stays."""
    slow = [squeeze(step_s=0.05, seed=k) for k in range(5)]
    coarse = [
        evolve(one, readings=tuple(
            reading._replace(frame=reading.frame._replace(gap_m=round(reading.frame.gap_m / 2e-4) * 2e-4))
            for reading in one.readings
        ))
        for one in slow
    ]  # fmt: skip
    for recordings in (slow, coarse):
        assert thresholds_for(recordings).settings == {}
        for one in recordings:
            times = np.array([reading.frame.t_s for reading in one.readings])
            gap = np.array([reading.frame.gap_m for reading in one.readings])
            since, _ = first_rest(times, gap, np.ones(len(times), dtype=bool), REST_SPEED_M_S, REST_WINDOW_S)
            assert times[since] == pytest.approx(1.5, abs=0.051)


def test_the_contact_force_stays_where_three_of_four_recordings_reach_it():
    strong, weak = [squeeze(peak_n=1.0, seed=k) for k in range(4)], [squeeze(peak_n=0.4, seed=9)]
    assert thresholds_for([*strong, *weak]).settings == {}
    assert "controller.contact_force_n" in thresholds_for([*strong[:2], *weak]).settings


def test_a_time_out_that_is_shorter_than_a_recording_is_extended():
    chosen = thresholds_for([squeeze()], {"move_timeout_s": 10.0, "steady_timeout_s": 1.5})
    assert chosen.settings == {"controller.steady_timeout_s": 2.0}
    assert "steady_timeout_s 2 s (recordings last up to 2 s)" in chosen.words
