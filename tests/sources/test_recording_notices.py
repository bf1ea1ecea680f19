"""What is noticed in the forces of a recording, whatever it was read from."""

from __future__ import annotations

from math import nan
from typing import Any

import numpy as np
from cases import every_case
from traces import made_recording

from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.sources.columns.recording_notices import with_notices

T_S = np.arange(300) * 0.01
LOAD_N = np.clip(T_S - 1.0, 0.0, 1.0) * 6.0
NOISE_N = np.random.default_rng(0).normal(0.0, 0.01, (2, len(T_S)))


def noticed(left: Any, right: Any, gap: Any = None, rate_hz: float = 100.0) -> tuple[str, ...]:
    gaps = np.full(len(left), 0.05) if gap is None else gap
    recording = made_recording(rate_hz, np.arange(len(left)) / rate_hz, gaps, left, right)
    return with_notices(LabelledRecording(recording=recording, source="squeeze")).notices


LEFT, RIGHT = LOAD_N + NOISE_N


@every_case("side", ["left", "right", "both"])
@every_case(
    ("spoilt", "says"),
    [
        (np.full(300, 4.5), "does not change"),
        (np.full(300, nan), "has no number"),
        (LEFT[np.minimum(np.arange(300), 120)], "repeats its last value"),
        # Reports that stop while the force grows, and go on a second later: 100 rows of one value.
        (
            LEFT[np.where((T_S >= 1.5) & (T_S < 2.5), 150, np.arange(300))],
            "repeats one value from 1.5 to 2.49 s",
        ),
        # The end of the range of a sensor, at half of the force, until the fingers open.
        (np.where(T_S < 2.8, np.minimum(LEFT, 3.0), NOISE_N[0]), "or is it at the end of its range"),
        # A converter of ten bits at its end, in the counts of a sensor without noise.
        (np.where(T_S < 2.8, np.minimum(np.round(400.0 * LOAD_N), 1023.0), 0.0), "at the end of its range"),
    ],
)
def test_a_sensor_that_says_nothing_is_noticed(spoilt: Any, says: str, side: str) -> None:
    (notice,) = noticed(
        spoilt if side in ("left", "both") else LEFT, spoilt if side in ("right", "both") else RIGHT
    )
    assert says in notice
    assert (side in notice) == (side != "both")


def test_healthy_forces_give_no_notice() -> None:
    assert noticed(LEFT, RIGHT) == ()
    # Without noise, or in coarse counts, a force repeats itself at rest.
    assert noticed(LOAD_N, LOAD_N) == ()
    assert noticed(np.round(LEFT * 4) / 4, np.round(RIGHT * 4) / 4) == ()
    released = np.where(T_S < 2.5, LOAD_N, 0.0)
    assert noticed(released, released) == ()
    # Noise of one count makes steps of one count, and a force at rest can stay within its count.
    few = np.round(LEFT * 50) / 50
    few[200:280] = few[200]
    assert noticed(few, few) == ()
    # A sensor that is read at every fifth row repeats each value four times.
    held = np.arange(300) // 5 * 5
    assert noticed(LEFT[held], RIGHT[held]) == ()


def test_a_force_that_is_measured_more_rarely_than_the_gap_is_noticed() -> None:
    """At 5 Hz, a contact and a squeeze of 0.3 s can be one new value."""
    fast = np.clip((T_S - 1.0) / 0.3, 0.0, 1.0) * 6.0 + NOISE_N[0]
    held = np.arange(300) // 20 * 20
    (notice,) = noticed(fast[held], fast[held])
    assert "every 0.2 s only" in notice
    # The same rows, if the gap is measured as rarely; and a force that grows for as long as ten values.
    assert noticed(fast[::20], fast[::20], rate_hz=5.0) == ()
    tenth = np.arange(300) // 10 * 10
    assert noticed(LEFT[tenth], RIGHT[tenth]) == ()


def test_a_gap_that_is_measured_more_rarely_than_the_force_is_noticed_and_a_coarse_one_is_not() -> None:
    closing = np.where(
        T_S < 1.0, 0.08 - 0.03 * T_S, 0.05 - 0.002 * (1.0 - np.exp(-np.clip(T_S - 1.0, 0.0, None) / 0.15))
    )
    (notice,) = noticed(LEFT, RIGHT, closing[np.arange(300) // 20 * 20])
    assert "every 0.2 s only" in notice
    assert noticed(LEFT, RIGHT, np.round(closing / 0.004) * 0.004) == ()


OPEN_AGAIN_M = np.where(T_S < 2.68, np.maximum(0.08 - 0.03 * T_S, 0.05), 0.05 + 0.1 * (T_S - 2.68))
RELEASED_N = np.where(T_S < 2.7, LOAD_N, 0.0) + NOISE_N[0]


@every_case("samples", [1, 2, 3])
def test_a_glitch_that_could_pass_for_a_contact_is_noticed(samples: int) -> None:
    spoilt = RELEASED_N.copy()
    spoilt[30 : 30 + samples] += 1.0  # before the contact; a contact is 0.625 N
    (notice,) = noticed(spoilt, spoilt, OPEN_AGAIN_M)
    assert "at 0.3 s" in notice
    # A tap of three samples is a glitch where it takes 30 ms, and none where it takes 300 ms.
    tapped = noticed(spoilt, spoilt, OPEN_AGAIN_M, rate_hz=10.0)
    assert not any("leaves its course" in notice for notice in tapped)


def test_the_code_of_an_error_in_the_force_is_noticed() -> None:
    spoilt = RELEASED_N.copy()
    spoilt[230] = -999.0
    (notice,) = noticed(spoilt, RELEASED_N, OPEN_AGAIN_M)
    assert "left pad" in notice
    assert "-999 N at 2.3 s" in notice


def test_a_zero_that_drifts_is_noticed_when_the_fingers_are_open_again() -> None:
    assert noticed(RELEASED_N, RELEASED_N, OPEN_AGAIN_M) == ()
    (notice,) = noticed(RELEASED_N, RELEASED_N + 0.5 * T_S, OPEN_AGAIN_M)
    assert "right pad ends +1.45 N" in notice  # 0.5 N/s between the means of ten samples at both ends
    # A recording that ends in the hold says nothing about it.
    held = slice(0, 260)
    assert noticed(RELEASED_N[held], RELEASED_N[held] + 0.5 * T_S[held], OPEN_AGAIN_M[held]) == ()


def test_a_gap_that_jumps_is_noticed() -> None:
    stopped = np.where((T_S >= 0.4) & (T_S < 0.9), OPEN_AGAIN_M[40], OPEN_AGAIN_M)
    (notice,) = noticed(RELEASED_N, RELEASED_N, stopped)
    assert "jumps by 15 mm within 10 ms (at 0.9 s)" in notice  # 30 mm/s for half a second
    # An encoder with steps of 5 mm goes on by one of them, also at 1 kHz.
    coarse = np.round(np.repeat(OPEN_AGAIN_M, 10) * 200) / 200
    forces = np.repeat(RELEASED_N, 10)
    assert noticed(forces, forces, coarse, rate_hz=1000.0) == ()


def test_a_force_that_goes_while_the_fingers_close_further_is_noticed() -> None:
    """As of fingers that touch something on their way; those that bounce off, or open, are another matter."""
    closing = 0.08 - 0.02 * T_S
    bump = np.where((T_S > 0.3) & (T_S < 0.45), 2.0, 0.0)
    (notice,) = noticed(LEFT + bump, RIGHT + bump, closing)
    assert "comes at 0.31 s" in notice
    # A tap before the fingers move.
    assert "comes at 0.31 s" in "".join(noticed(LEFT + bump, RIGHT + bump, np.minimum(closing, 0.07)))
    assert noticed(LEFT, RIGHT, closing) == ()
    assert noticed(LEFT + bump, RIGHT + bump) == ()
    assert noticed(LEFT + 0.2 * bump, RIGHT + 0.2 * bump, closing) == ()  # below the force of a contact


def test_a_gap_that_is_slower_than_the_samples_has_not_stopped() -> None:
    """50 Hz in a recording of 1000 Hz: each gap of fingers that creep holds for 20 samples."""
    t_s = np.arange(3000) * 0.001
    gap = np.where(t_s < 2.46, 0.05 - 0.001 * np.maximum(t_s - 1.0, 0.0), 0.05 + 0.05 * (t_s - 2.46))
    load = np.where((t_s > 1.0) & (t_s < 2.45), np.minimum(t_s - 1.0, 0.5) * 12.0, 0.0)
    load += np.random.default_rng(1).normal(0.0, 0.01, len(t_s))
    assert noticed(load, load, gap[np.arange(3000) // 20 * 20], rate_hz=1000.0) == ()


def test_a_gap_that_stops_in_the_squeeze_is_noticed() -> None:
    squeeze = 0.05 - 0.002 * (1.0 - np.exp(-np.clip(T_S - 1.0, 0.0, None) / 0.3))
    gap = np.where(T_S < 1.0, OPEN_AGAIN_M, np.where(T_S < 2.68, squeeze, squeeze + 0.1 * (T_S - 2.68)))
    assert noticed(RELEASED_N, RELEASED_N, gap) == ()
    for until_s, says in ((1.6, "then jumps by 1.42 mm"), (9.0, "although the force is gone")):
        stopped = np.where((T_S >= 1.05) & (until_s > T_S), gap[105], gap)
        (notice,) = noticed(RELEASED_N, RELEASED_N, stopped)
        assert says in notice
    # A rigid object, and one whose force is raised in steps while the gap follows at once.
    assert noticed(RELEASED_N, RELEASED_N, OPEN_AGAIN_M) == ()
    stairs = np.floor(np.clip(T_S - 1.0, 0.0, 1.0) * 4.0)
    force = np.where(T_S < 2.7, 1.5 * stairs, 0.0) + NOISE_N[0]
    assert noticed(force, force, np.where(T_S < 2.68, OPEN_AGAIN_M - 0.0005 * stairs, OPEN_AGAIN_M)) == ()


def test_a_slow_gap_that_opens_after_a_hold_without_creep_has_not_stopped() -> None:
    """50 Hz in a recording of 1000 Hz: the first step of an opening at 0.2 m/s is 4 mm, and so is the next one."""
    t_s = np.arange(3000) * 0.001
    closing = np.where(t_s < 1.2, np.maximum(0.08 - 0.03 * t_s, 0.0485), 0.0485)
    gap = np.where(t_s < 2.5, closing, 0.0485 + 0.2 * (t_s - 2.5))
    load = np.where(
        t_s > 1.0, np.minimum((t_s - 1.0) / 0.25, 1.0) * (6.0 - np.clip(t_s - 1.25, 0.0, 1.0)), 0.0
    )
    load = load * np.clip((2.55 - t_s) / 0.05, 0.0, 1.0) + np.random.default_rng(1).normal(
        0.0, 0.01, len(t_s)
    )
    for every in (1, 10, 20, 50):
        assert noticed(load, load, gap[np.arange(3000) // every * every], rate_hz=1000.0) == ()
    # One that had stopped goes on, in the hold, by what it has missed.
    stopped = np.where((t_s >= 0.9) & (t_s < 1.6), gap[900], gap)[np.arange(3000) // 20 * 20]
    (notice,) = noticed(load, load, stopped, rate_hz=1000.0)
    assert "then jumps by 4.5 mm" in notice


def test_a_force_without_noise_that_stays_after_the_fingers_opened_is_noticed() -> None:
    quick = np.clip((T_S - 1.0) / 0.15, 0.0, 1.0) * 6.0
    (notice,) = noticed(quick, quick, OPEN_AGAIN_M)
    assert "or its sensor stopped" in notice
    released = np.where(T_S < 2.7, quick, 0.0)
    assert noticed(released, released, OPEN_AGAIN_M) == ()
    # At 2 Hz the last value of a force can be one of the hold.
    slow = released[np.arange(300) // 50 * 50]
    assert not any("sensor stopped" in notice for notice in noticed(slow, slow, OPEN_AGAIN_M))


@every_case(("rate_hz", "samples"), [(50.0, 4), (20.0, 1), (20.0, 2), (200.0, 8)])
def test_a_glitch_under_a_load_is_noticed_at_any_rate(rate_hz: float, samples: int) -> None:
    t_s = np.arange(0.0, 2.0, 1.0 / rate_hz)
    course = np.interp(t_s, [0.6, 0.9, 1.5, 1.6], [0.0, 9.0, 8.5, 0.0])
    course += np.random.default_rng(2).normal(0.0, 0.01, len(t_s))
    gap = np.interp(t_s, [0.0, 0.6, 0.9, 1.5, 1.7], [0.08, 0.05, 0.0494, 0.0494, 0.06])
    assert noticed(course, course, gap, rate_hz=rate_hz) == ()
    spoilt = course.copy()
    spoilt[int(1.1 * rate_hz) :][:samples] = 60.0
    (notice,) = noticed(spoilt, spoilt, gap, rate_hz=rate_hz)
    assert "60 N at 1.1 s" in notice


@every_case("side", ["left", "right"])
@every_case("from_s", [0.0, 0.5, 1.5, 2.0])
def test_a_pad_that_feels_nothing_but_noise_while_the_other_is_loaded_is_noticed(
    from_s: float, side: str
) -> None:
    dead = np.where(from_s <= T_S, NOISE_N[1], RELEASED_N)
    pads = (dead, RELEASED_N) if side == "left" else (RELEASED_N, dead)
    (notice,) = (notice for notice in noticed(*pads, OPEN_AGAIN_M) if "leaves its course" not in notice)
    assert f"{side} pad stays at" in notice
    assert "while the other pad feels up to 6" in notice


@every_case("from_s", [1.6, 2.0])
@every_case("lasts_s", [0.05, 0.2])
def test_a_pad_that_feels_nothing_for_a_moment_under_a_load_is_noticed(from_s: float, lasts_s: float) -> None:
    failed = np.where((from_s < T_S) & (from_s + lasts_s > T_S), NOISE_N[1], RELEASED_N)
    notices = noticed(failed, RELEASED_N, OPEN_AGAIN_M)
    assert [notice for notice in notices if "left pad stays at" in notice]


SHARES = {
    "half": 0.5,
    "a tenth": 0.1,
    "half from the hold on": np.where(T_S < 2.0, 1.0, 0.5),
    "less and less": np.clip(1.6 - 0.4 * T_S, 0.5, 1.0),
    "exchanged": np.where(T_S < 2.0, 0.6, 1.0 / 0.6),
    "a saturated sensor": np.minimum(1.0, 3.5 / np.maximum(LOAD_N, 0.1)),
}


@every_case("share", SHARES)
@every_case("units", [{}, {"force_left": "counts", "force_right": "counts"}])
def test_opposed_pads_that_bear_different_forces_are_noticed(share: str, units: dict[str, str]) -> None:
    """Sensors in counts can be of different kinds, but what one is of the other stays."""

    def told(left: Any, right: Any) -> bool:
        recording = made_recording(100.0, T_S, OPEN_AGAIN_M, left, right, units=units)
        labelled = with_notices(LabelledRecording(recording=recording, source="squeeze"))
        return any("of the force of both" in notice for notice in labelled.notices)

    released = RELEASED_N - NOISE_N[0]
    left, right = SHARES[share] * released + NOISE_N[1], RELEASED_N
    constant = np.ndim(SHARES[share]) == 0
    assert told(left, right) == told(right, left) == (not units or not constant)
    for sound in (0.9 * released, np.where(T_S < 1.1, 0.0, released), released + 0.3):
        assert not told(sound + NOISE_N[1], right)


def test_a_sound_pad_that_reads_low_or_feels_the_object_later_is_not_doubted() -> None:
    for low in (0.5 * RELEASED_N, 0.1 * RELEASED_N, np.where(T_S < 1.2, NOISE_N[1], RELEASED_N)):
        for pads in ((low, RELEASED_N), (RELEASED_N, low)):
            assert not any("stays at" in notice for notice in noticed(*pads, OPEN_AGAIN_M))


def test_pads_that_are_exchanged_under_a_load_are_noticed() -> None:
    """One that reads a fifth less is sound by itself, so only the step tells it."""
    low = 0.8 * (RELEASED_N - NOISE_N[0]) + NOISE_N[1]
    assert noticed(low, RELEASED_N, OPEN_AGAIN_M) == ()
    for since_s in (1.6, 2.0):
        later = since_s <= T_S
        (notice,) = noticed(np.where(later, RELEASED_N, low), np.where(later, low, RELEASED_N), OPEN_AGAIN_M)
        assert "part by" in notice
        assert f"at {since_s:g} s" in notice


@every_case("share", [0.06, 0.2])
@every_case("rate_hz", [50.0, 1000.0])
def test_a_force_whose_single_values_are_wrong_is_noticed(share: float, rate_hz: float) -> None:
    t_s = np.arange(0.0, 3.0, 1.0 / rate_hz)
    force, gap = np.interp(t_s, T_S, RELEASED_N - NOISE_N[0]), np.interp(t_s, T_S, OPEN_AGAIN_M)
    hum = share * 6.0 * np.sin(2.0 * np.pi * 60.0 * t_s + 0.3)
    noise = share * 6.0 * np.random.default_rng(4).normal(0.0, 1.0, len(t_s))
    assert noticed(force, force, gap, rate_hz=rate_hz) == ()
    for spoilt in (force + hum, force + noise):
        assert any("around its course" in notice for notice in noticed(spoilt, spoilt, gap, rate_hz=rate_hz))
    coarse = np.round(force / (share * 6.0)) * share * 6.0
    told = noticed(coarse, coarse, gap, rate_hz=rate_hz)
    assert any("has steps of" in notice for notice in told) == (share > 0.1)  # half a step is 3 or 10 %


@every_case("late_s", [0.2, 0.3, 0.5])
def test_a_gap_or_a_force_that_comes_late_is_noticed(late_s: float) -> None:
    late = np.maximum(np.arange(300) - round(100 * late_s), 0)
    squeeze = 0.05 - 0.0005 * (RELEASED_N - NOISE_N[0])
    gap = np.where(T_S < 1.0, OPEN_AGAIN_M, np.where(T_S < 2.68, squeeze, 0.047 + 0.1 * (T_S - 2.68)))
    released = np.where(T_S < 2.3, LOAD_N, 0.0) + NOISE_N[0]
    opened = np.where(T_S < 2.29, gap, 0.047 + 0.1 * (T_S - 2.29))
    assert noticed(released, released, opened) == ()
    for force, gaps, says in (
        (released[late], opened, "the force stays"),
        (released, opened[late], "gap come late"),
    ):
        assert any(says in notice for notice in noticed(force, force, gaps))
    # Fingers that are relaxed some time before they open, on something rigid.
    rigid = np.where(
        2.29 + late_s > T_S, np.maximum(0.08 - 0.03 * T_S, 0.05), 0.05 + 0.1 * (T_S - 2.29 - late_s)
    )
    assert not any("late" in notice for notice in noticed(released, released, rigid))


def test_a_force_that_rises_at_once_under_a_load_is_noticed() -> None:
    """As where samples without a time of their own are missing; the same squeeze at a lower rate has such steps too."""
    kept = (T_S < 1.5) | (T_S >= 1.7)
    (notice,) = noticed(RELEASED_N[kept], RELEASED_N[kept], OPEN_AGAIN_M[kept])
    assert "rises by 1.2" in notice  # 6 N/s for 0.2 s
    assert "at 1.5 s" in notice
    assert noticed(RELEASED_N[::5], RELEASED_N[::5], OPEN_AGAIN_M[::5], rate_hz=20.0) == ()
    stairs = np.floor(np.clip(T_S - 1.0, 0.0, 1.0) * 4.0) * (T_S < 2.7) + NOISE_N[0]
    assert noticed(stairs, stairs, OPEN_AGAIN_M) == ()


def test_a_gap_that_jumps_at_a_moderate_speed_is_noticed() -> None:
    """4 mm within 10 ms are no speed that a finger never has, but none gains and loses it in one sample."""
    for since_s in (0.4, 1.5, 2.0):
        jumped = OPEN_AGAIN_M + np.where(since_s <= T_S, 0.004, 0.0)
        (notice,) = (text for text in noticed(RELEASED_N, RELEASED_N, jumped) if "the gap jumps" in text)
        assert "within 10 ms" in notice
    fast = np.interp(T_S, [0.0, 0.3, 0.34, 1.0, 2.68, 2.7, 3.0], [0.08, 0.08, 0.072, 0.05, 0.05, 0.054, 0.08])
    assert noticed(RELEASED_N, RELEASED_N, fast) == ()
