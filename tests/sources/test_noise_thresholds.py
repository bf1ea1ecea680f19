"""The thresholds that an import chooses where the defaults do not fit the noise of its recordings."""

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from traces import made_recording

from graspsense.core.control.contact import CONTACT_FORCE_N, REST_SPEED_M_S, REST_WINDOW_S, first_rest
from graspsense.core.values.features import Features
from graspsense.sources.recordings.doubtful_rests import notices_of_rests
from graspsense.sources.recordings.noise_thresholds import thresholds_for


def squeeze(peak_n=8.0, force_noise_n=0.01, gap_noise_m=0.0, step_s=0.001, seed=0, **more):
    """A gap that closes for a second until the force rises for half a second, then rests for half a second."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, 2.0, step_s)
    gap = np.interp(times, [0.0, 1.0, 1.5], [0.08, 0.06, 0.055]) + gap_noise_m * rng.normal(size=len(times))
    force = np.interp(times, [0.0, 1.0, 1.5], [0.0, 0.0, peak_n])
    pads = force[:, np.newaxis] + force_noise_n * rng.normal(size=(len(times), 2))
    return made_recording(1.0 / step_s, times, gap, *pads.T, **more)


def reframed(recording, change, **more):
    """Return the recording with other fields in its frames: those that `change` makes of each frame."""
    readings = tuple(
        reading._replace(frame=reading.frame._replace(**change(reading.frame)))
        for reading in recording.readings
    )
    return evolve(recording, readings=readings, **more)


def series(recording, *names):
    return (np.array([getattr(reading.frame, name) for reading in recording.readings]) for name in names)


def in_units(recording, units, force=1.0, gap=1.0, time=1.0, offset=0.0):
    """The recording with its numbers in other units; `offset` is the force of a sensor without a load."""

    def change(frame):
        left_n, right_n = (n * force + offset for n in (frame.force_left_n, frame.force_right_n))
        return {
            "t_s": frame.t_s * time,
            "gap_m": frame.gap_m * gap,
            "force_left_n": left_n,
            "force_right_n": right_n,
        }

    names = {"force": ("force_left", "force_right"), "gap": ("gap",), "t": ("t",)}
    renamed = {name: unit for quantity, unit in units.items() for name in names[quantity]}
    return reframed(recording, change, units=renamed)


@every_case(
    ("factors", "units"),
    [
        ({"force": 250.0, "offset": 2000.0}, {"force": "counts"}),
        ({"gap": 1000.0}, {"gap": "deg"}),
        ({"force": 250.0, "time": 100.0}, {"force": "counts", "t": "sample"}),
        ({"force": 1e-3, "gap": 40.0, "time": 100.0}, {"force": "V", "gap": "V", "t": "sample"}),
    ],
)
def test_thresholds_follow_from_recordings_in_any_unit(factors, units):
    """The same squeezes in other units have the contact at the same time, and come to rest."""
    recordings = [in_units(squeeze(step_s=0.01, seed=k), **factors, units=units) for k in range(5)]
    settings = {key.partition(".")[2]: value for key, value in thresholds_for(recordings).settings.items()}
    speed = settings.get("rest_speed_m_s", REST_SPEED_M_S)
    window = settings.get("rest_window_s", REST_WINDOW_S)
    for recording in recordings:
        times, gap, left, right = series(recording, "t_s", "gap_m", "force_left_n", "force_right_n")
        onset = int((np.minimum(left, right) >= settings.get("contact_force_n", CONTACT_FORCE_N)).argmax())
        assert 1.0 < onset * 0.01 < 1.1
        since, _ = first_rest(
            times[onset:], gap[onset:], np.ones(len(times) - onset, dtype=bool), speed, window
        )
        assert (onset + since) * 0.01 == pytest.approx(1.5, abs=0.05)
        if "gap" in units:
            assert settings["closed_gap_m"] < gap.min()
            assert settings["too_wide_m"] < 0.0


def coarse(recording, step_m):
    return reframed(recording, lambda frame: {"gap_m": round(frame.gap_m / step_m) * step_m})


def slow_squeeze(hold_s, step_s=0.0222, seed=0):
    """Closing at 8 mm/s, and a squeeze of 2.4 mm to 8 N in 3 s."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, 4.5 + hold_s, step_s)
    gap = np.interp(times, [0.0, 1.5, 4.5], [0.076, 0.064, 0.0616])
    force = np.interp(times, [1.5, 4.5], [0.0, 8.0]) + 0.004 * rng.normal(size=len(times))
    return made_recording(1.0 / step_s, times, gap, force, force)


@every_case("step_s", [0.0222, 0.1])
@every_case(("step_m", "hold_s"), [(1e-4, 1.5), (1e-4, 0.8), (5e-5, 1.0)])
def test_the_window_of_rest_is_that_of_a_step_of_the_gap(step_s, step_m, hold_s):
    recordings = [coarse(slow_squeeze(hold_s, step_s, seed=k), step_m) for k in range(5)]
    chosen = thresholds_for(recordings)
    speed = chosen.settings.get("controller.rest_speed_m_s", REST_SPEED_M_S)
    window = chosen.settings.get("controller.rest_window_s", REST_WINDOW_S)
    assert speed < 0.4e-3, "half the speed of the squeeze"
    if 8e-4 * step_s < step_m:  # the gap repeats its numbers
        assert speed * window >= step_m
        assert "steps of" in chosen.words
    for recording in recordings:
        times, gap, force = series(recording, "t_s", "gap_m", "force_left_n")
        k = int((force > 0.625).argmax())
        _, shown = first_rest(times[k:], gap[k:], np.ones(len(times) - k, dtype=bool), speed, window)
        assert force[k + shown] == pytest.approx(8.0, rel=0.05)


def test_a_window_of_rest_that_ends_in_the_release_shows_none():
    """A gap in steps of 1 mm stays for 25 ms after the fingers open, in which half of the force goes."""
    t_s = np.arange(400) * 0.01
    pressed = np.where(t_s > 1.3, 2.0 * (1.0 - np.exp(-np.clip(t_s - 1.3, 0.0, None) / 0.15)), 0.0)
    opening = 40.0 * np.clip(t_s - 3.39, 0.0, None)
    gap = np.floor(np.clip(80.0 - 30.0 * (t_s - 0.3), 50.0, 80.0) - pressed + opening) * 1e-3
    force = np.maximum(5.0 * (pressed - opening), 0.0)
    chosen = thresholds_for([made_recording(100.0, t_s, gap, force, force)]).settings
    speed, window = chosen["controller.rest_speed_m_s"], chosen["controller.rest_window_s"]
    k = int((force >= CONTACT_FORCE_N).argmax())
    resting = first_rest(t_s[k:], gap[k:], np.ones(len(t_s) - k, dtype=bool), speed, window)
    assert resting is None or force[k + resting[1]] > 9.0


def test_a_window_that_is_given_decides_the_speed():
    recordings = [coarse(slow_squeeze(1.5, seed=k), 1e-4) for k in range(3)]
    settings = thresholds_for(recordings, {}, {"rest_window_s": 0.3}).settings
    assert settings["controller.rest_window_s"] == 0.3
    assert settings["controller.rest_speed_m_s"] == pytest.approx(1e-4 / 0.3, rel=0.1)


def test_slow_recordings_whose_gap_is_still_at_rest_keep_the_thresholds_of_rest():
    """Coarse steps while the fingers move are not noise: with these thresholds rest is where the gap stays."""
    slow = [squeeze(step_s=0.05, seed=k) for k in range(5)]
    for recordings in (slow, [coarse(recording, 2e-4) for recording in slow]):
        assert thresholds_for(recordings).settings == {}
        for recording in recordings:
            times, gap = series(recording, "t_s", "gap_m")
            since, _ = first_rest(times, gap, np.ones(len(times), dtype=bool), REST_SPEED_M_S, REST_WINDOW_S)
            assert times[since] == pytest.approx(1.5, abs=0.051)


def test_recordings_that_begin_in_contact_with_different_forces_are_in_contact_from_the_beginning():
    """Pressures in counts that hold from the first sample: their offsets differ by more than their noise."""
    held = []
    for k, offset in enumerate((950.0, 1000.0, 1050.0, 1200.0, 1400.0)):
        recording = squeeze(seed=k, units={"force_left": "counts", "force_right": "counts"})
        noise = iter(np.random.default_rng(k).normal(size=len(recording.readings)).tolist())

        def change(frame, offset=offset, noise=noise):
            return dict.fromkeys(("force_left_n", "force_right_n"), offset + next(noise))

        held.append(reframed(recording, change))
    thresholds = thresholds_for(held)
    assert 0.0 < thresholds.settings["controller.contact_force_n"] <= 950.0
    assert "from the beginning" in thresholds.words


FORCE, REST_SPEED, REST_WINDOW = (
    f"controller.{key}" for key in ("contact_force_n", "rest_speed_m_s", "rest_window_s")
)
WHOLE = squeeze()
CLOSE = evolve(WHOLE, readings=WHOLE.readings[980:])
STRONG, WEAK = [squeeze(peak_n=1.0, seed=k) for k in range(4)], [squeeze(peak_n=0.4, seed=9)]


def several(count=5, begin=0, **given):
    return [
        evolve(made, readings=made.readings[begin:])
        for made in (squeeze(seed=k, **given) for k in range(count))
    ]


@every_case(
    ("recordings", "settings", "words"),
    [
        (several(), {}, "the defaults"),
        # A hand whose fingers feel 0.5 N at most never touches by the default: above the noise, and below the peak.
        (several(peak_n=0.5), {FORCE: (0.04, 0.25)}, "default 0.625 N"),
        # Above what the noise of 0.5 N reaches in 10 000 samples.
        (several(peak_n=40.0, force_noise_n=0.5), {FORCE: (1.8, 20.0)}, "contact_force_n"),
        # At a low rate it is not that of a steep rise.
        *((several(peak_n=0.5, step_s=step_s), {FORCE: (0.03, 0.1)}, "") for step_s in (0.1, 0.05)),
        # A slow squeeze that begins in contact: its first third reaches 1.6 N of 25 N, which is no noise.
        (several(peak_n=25.0, begin=1000), {FORCE: None}, ""),
        # Three of four recordings reach the default.
        ([*STRONG, *WEAK], {}, ""),
        ([*STRONG[:2], *WEAK], {FORCE: (0.0, 0.4)}, ""),
        (several(3, peak_n=0.0, force_noise_n=1.0), {}, "check the unit"),
        # Metres and newtons of a data set that counts frames are nominal, and were chosen for the defaults.
        ([in_units(squeeze(peak_n=0.5, step_s=0.1), {"t": "frame"}, time=10.0)], {}, ""),
        ([WHOLE, CLOSE], {"controller.too_wide_m": (0.0, 0.0)}, "1 of 2 recordings"),
        # An object of two millimetres is not nothing.
        (
            [reframed(WHOLE, lambda frame: {"gap_m": frame.gap_m - 0.0535})],
            {"controller.closed_gap_m": (-1.0, 0.0015)},
            "closed_gap_m",
        ),
        # The window is several samples; closing at 0.01 to 0.02 m/s is not rest.
        (several(gap_noise_m=2e-5), {REST_SPEED: (0.0, 0.005), REST_WINDOW: (0.005, 1.0)}, ""),
        (several(gap_noise_m=2e-5, step_s=0.05), {REST_SPEED: (0.0, 0.005), REST_WINDOW: (0.25, 1.0)}, ""),
    ],
)
def test_thresholds_are_those_of_the_recordings(recordings, settings, words):
    chosen = thresholds_for(recordings)
    assert words in chosen.words
    assert settings or not chosen.settings or "check" in words
    for key, limits in settings.items():
        assert (
            key not in chosen.settings if limits is None else limits[0] <= chosen.settings[key] <= limits[1]
        )
    if REST_SPEED in settings:
        assert chosen.settings[REST_SPEED] * chosen.settings[REST_WINDOW] >= 4 * 2e-5


def test_a_time_out_that_is_shorter_than_a_recording_is_extended():
    chosen = thresholds_for([WHOLE], {"move_timeout_s": 10.0, "steady_timeout_s": 1.5})
    assert chosen.settings == {"controller.steady_timeout_s": 2.0}
    assert "up to 2 s" in chosen.words


def test_the_thresholds_of_rest_are_not_those_of_open_fingers():
    """A hold of 0.3 s on a coarse gap, a release, and a second of open fingers: a window of that length fits both."""
    times = np.arange(0.0, 4.5, 0.01)
    gap = np.interp(times, [0.0, 1.0, 3.0, 3.3, 3.6], [0.07, 0.06, 0.054, 0.054, 0.07])
    force = np.interp(times, [1.0, 3.0, 3.3, 3.4], [0.0, 8.0, 8.0, 0.0])
    recording = coarse(made_recording(100.0, times, gap, force, force), 5e-5)
    assert thresholds_for([recording]).settings[REST_WINDOW] <= 0.3


SQUEEZED = slow_squeeze(hold_s=1.0)
STUCK = coarse(SQUEEZED, 0.032)
# The gap closes by 12 mm, and by 0.1 mm of them after the contact.
RIGID = reframed(SQUEEZED, lambda frame: {"gap_m": frame.gap_m - (23 / 24) * min(frame.gap_m - 0.064, 0.0)})


@every_case(
    ("recording", "rest_mm", "rest_n", "goes_on"),
    [
        # The squeeze closes from 64 to 61.6 mm with up to 8 N, or stays at 64 mm.
        (STUCK, 64.0, 3.6, True),
        (SQUEEZED, 63.0, 3.6, True),
        (SQUEEZED, 61.7, 3.6, False),
        (SQUEEZED, 61.6, 0.1, True),  # the force is gone, and the fingers have not opened
        (RIGID, 63.9, 5.0, True),
        (RIGID, 63.9, 7.5, False),
    ],
)
def test_a_rest_before_most_of_the_force_is_doubted_also_where_the_gap_shows_no_travel(
    recording, rest_mm, rest_n, goes_on
):
    values = (0.064, rest_mm / 1e3, rest_n)
    features = Features(names=("p_first", "p_steady", "f_steady"), values=values, units=("m", "m", "N"))
    assert bool(notices_of_rests([(features, recording)], "features")) is goes_on
