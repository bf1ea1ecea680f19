"""What is noticed in the forces of a recording, whatever it was read from."""

from math import inf, nan
from typing import Any

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st
from traces import made_recording

from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.sources.columns.recording_notices import with_notices

T_S = np.arange(300) * 0.01
LOAD_N = np.clip(T_S - 1.0, 0.0, 1.0) * 6.0
NOISE_N = np.random.default_rng(0).normal(0.0, 0.01, (2, len(T_S)))
LEFT, RIGHT = LOAD_N + NOISE_N
OPEN_AGAIN_M = np.where(T_S < 2.68, np.maximum(0.08 - 0.03 * T_S, 0.05), 0.05 + 0.1 * (T_S - 2.68))
RELEASED_N = np.where(T_S < 2.7, LOAD_N, 0.0) + NOISE_N[0]


def noticed(
    left: Any, right: Any = None, gap: Any = None, rate_hz: float = 100.0, **units: str
) -> tuple[str, ...]:
    """Return the notices of a recording; without a right pad both feel the same, without a gap it stays."""
    times = np.arange(len(left)) / rate_hz
    gaps = np.full(len(left), 0.05) if gap is None else gap
    recording = made_recording(rate_hz, times, gaps, left, left if right is None else right, units=units)
    return with_notices(LabelledRecording(recording=recording, source="squeeze")).notices


SAMPLE = st.tuples(*(st.sampled_from([nan, inf, -1e12, 0.0, 0.05, 3.0]) for _ in range(3)))


@given(st.lists(st.tuples(SAMPLE, st.integers(1, 12)), max_size=8))
def test_every_recording_has_notices_also_one_without_a_sample(runs: Any) -> None:
    samples = np.array([sample for sample, times in runs for _ in range(times)]).reshape(-1, 3)
    assert all(noticed(*samples.T, 50.0))


def kept(samples: int) -> Any:
    """Return the row whose value each row has where a channel is read at every so many rows only."""
    return np.arange(len(T_S)) // samples * samples


def spoilt(begin: int, values: Any, force: Any = RELEASED_N) -> Any:
    """Return this force with other values from this row on."""
    changed = force.copy()
    changed[begin : begin + len(values)] = values
    return changed


@every_case("side", ["left", "right", "both"])
@every_case(
    ("spoilt", "says"),
    [
        (np.full(300, 4.5), "does not change"),
        (np.full(300, nan), "has no number"),
        (LEFT[np.minimum(np.arange(300), 120)], "its last value"),
        # Reports that stop while the force grows, and go on a second later: 100 rows of one value.
        (LEFT[np.where((T_S >= 1.5) & (T_S < 2.5), 150, np.arange(300))], "1.5 to 2.49 s"),
        # The end of the range of a sensor, at half of the force, until the fingers open.
        (np.where(T_S < 2.8, np.minimum(LEFT, 3.0), NOISE_N[0]), "or is it"),
        # A converter of ten bits at its end, in the counts of a sensor without noise.
        (np.where(T_S < 2.8, np.minimum(np.round(400.0 * LOAD_N), 1023.0), 0.0), "end of its range"),
    ],
)  # fmt: skip
def test_a_sensor_that_says_nothing_is_noticed(spoilt: Any, says: str, side: str) -> None:
    (notice,) = noticed(spoilt if side != "right" else LEFT, spoilt if side != "left" else RIGHT)
    assert says in notice
    assert (side in notice) == (side != "both")


# At 5 Hz, a contact and a squeeze of 0.3 s can be one new value.
FAST_N = np.clip((T_S - 1.0) / 0.3, 0.0, 1.0) * 6.0 + NOISE_N[0]
CREEP_M = np.where(
    T_S < 1.0, 0.08 - 0.03 * T_S, 0.05 - 0.002 * (1.0 - np.exp(-np.clip(T_S - 1.0, 0.0, None) / 0.15))
)
CLOSING_M = 0.08 - 0.02 * T_S
BUMP_N = np.where((T_S > 0.3) & (T_S < 0.45), 2.0, 0.0)
SQUEEZE_M = 0.05 - 0.002 * (1.0 - np.exp(-np.clip(T_S - 1.0, 0.0, None) / 0.3))
SOFT_M = np.where(T_S < 1.0, OPEN_AGAIN_M, np.where(T_S < 2.68, SQUEEZE_M, SQUEEZE_M + 0.1 * (T_S - 2.68)))
STAIRS = np.floor(np.clip(T_S - 1.0, 0.0, 1.0) * 4.0)
QUICK_N = np.clip((T_S - 1.0) / 0.15, 0.0, 1.0) * 6.0
HELD = slice(0, 260)
"""A recording that ends in the hold."""
# One that reads a fifth less is sound by itself, so only the step tells that the pads are exchanged.
LOW_N = 0.8 * (RELEASED_N - NOISE_N[0]) + NOISE_N[1]
LINE_N = np.interp(T_S, [0.8, 1.5], [0.0, 3.0])
TWICE = np.concatenate((np.arange(160), np.arange(110, 300)))
# As where samples without a time of their own are missing.
CUT = (T_S < 1.5) | (T_S >= 1.7)

TOLD = {
    "a force that is measured more rarely than the gap": ("every 0.2 s only", FAST_N[kept(20)]),
    "a gap that is measured more rarely than the force": ("every 0.2 s only", LEFT, RIGHT, CREEP_M[kept(20)]),
    "the code of an error": ("left pad leaves its course", spoilt(230, [-999.0]), RELEASED_N, OPEN_AGAIN_M),
    # 0.5 N/s between the means of ten samples at both ends.
    "a zero that drifts": ("right pad ends +1.45 N", RELEASED_N, RELEASED_N + 0.5 * T_S, OPEN_AGAIN_M),
    # As of fingers that touch something on their way; those that bounce off, or open, are another matter.
    "a force that goes while the fingers close": ("comes at 0.31 s", LEFT + BUMP_N, RIGHT + BUMP_N, CLOSING_M),
    "a gap that stops in the squeeze": (
        "the gap jumps by 1.42 mm", RELEASED_N, None, np.where((T_S >= 1.05) & (T_S < 1.6), SOFT_M[105], SOFT_M)
    ),
    "a gap that stops for good": (
        "although the force is gone", RELEASED_N, None, np.where(T_S >= 1.05, SOFT_M[105], SOFT_M)
    ),
    "a force without noise that stays": ("or its sensor stopped", QUICK_N, None, OPEN_AGAIN_M),
    **{
        f"pads that are exchanged at {s} s": (
            f"at {s} s", np.where(s <= T_S, RELEASED_N, LOW_N), np.where(s <= T_S, LOW_N, RELEASED_N), OPEN_AGAIN_M
        )
        for s in (1.6, 2)
    },
    # As a program fills in what was lost, from before the contact until half of the force is there.
    "missing samples that were filled in": (
        "straight line from 0.81 to 1.49 s", np.where((T_S > 0.8) & (T_S < 1.5), LINE_N, RELEASED_N), None, OPEN_AGAIN_M
    ),
    "the same in the gap": (
        "gap is a straight line", RELEASED_N, None,
        np.where((T_S > 0.4) & (T_S < 1.1), np.interp(T_S, [0.4, 1.1], [0.068, 0.05]), OPEN_AGAIN_M + NOISE_N[1] / 5e3),
    ),
    "a force at 2.5 Hz between whose values a program draws lines": (
        "every 0.4 s only", np.interp(T_S, T_S[::40], RELEASED_N[::40]), None, OPEN_AGAIN_M
    ),
    "zeros for a gap that was not read": (
        "the gap leaves its course", RELEASED_N, None,
        np.where(np.isin(np.arange(300), [30, 90, 150, 220]), 0.0, OPEN_AGAIN_M),
    ),
    "the friction of a drive in the current of its motor": (
        "stays low until 1.21 s", RELEASED_N + np.where((T_S > 0.1) & (T_S < 2.7), 0.8, 0.0), None, OPEN_AGAIN_M
    ),
    "a zero that is set under a load": (
        "falls by 2.57 N", spoilt(150, LEFT[150:] - LEFT[150], LEFT), spoilt(150, RIGHT[150:] - RIGHT[150], RIGHT)
    ),
    # A third of a second, in which no noise repeats itself.
    "values that stay for the contact": (
        "repeats one value from 0.9 to 1.06 s", spoilt(90, np.full(17, LEFT[90])), None, OPEN_AGAIN_M
    ),
    "fingers that are elsewhere at the next of 20 samples a second": (
        "jumps by 18 mm within 50 ms", RELEASED_N[::5], None,
        np.where((T_S >= 0.3) & (T_S < 0.9), OPEN_AGAIN_M[30], OPEN_AGAIN_M)[::5] + NOISE_N[1, ::5] / 5e3, 20.0,
    ),
    "lines that were written twice": ("from 1.1 s on come again", RELEASED_N[TWICE], None, SOFT_M[TWICE]),
    # 6 N/s for 0.2 s.
    "a force that rises at once": ("rises by 1.2", RELEASED_N[CUT], None, OPEN_AGAIN_M[CUT]),
}  # fmt: skip


@every_case("case", TOLD)
def test_what_looks_wrong_is_noticed_once(case: str) -> None:
    says, *recording = TOLD[case]
    (notice,) = noticed(*recording)
    assert says in notice


STAIRS_M = np.interp(
    T_S, [0, 1, 1.4, 1.5, 1.9, 2.0, 2.4, 2.5], 0.08 - 0.01 * np.array([0, 3, 3, 4, 4, 5, 5, 6])
)
SOUND = {
    "noise": (LEFT, RIGHT),
    "no noise, so that the force repeats itself at rest": (LOAD_N,),
    "coarse counts": (np.round(LEFT * 4) / 4, np.round(RIGHT * 4) / 4),
    # Noise of one count makes steps of one count, and a force at rest can stay within its count.
    "counts at rest": (spoilt(200, np.full(80, round(LEFT[200] * 50) / 50), np.round(LEFT * 50) / 50),),
    "a sensor that is read at every fifth row": (LEFT[kept(5)], RIGHT[kept(5)]),
    "a gap that is measured as rarely as the force": (FAST_N[::20], None, None, 5.0),
    "a force that grows for as long as ten values": (LEFT[kept(10)], RIGHT[kept(10)]),
    "a coarse gap": (LEFT, RIGHT, np.round(CREEP_M / 0.004) * 0.004),
    "a rigid object": (RELEASED_N, None, OPEN_AGAIN_M),
    "a drift in a recording that ends in the hold": (
        RELEASED_N[HELD], RELEASED_N[HELD] + 0.5 * T_S[HELD], OPEN_AGAIN_M[HELD]
    ),
    # An encoder with steps of 5 mm goes on by one of them, also at 1 kHz.
    "coarse steps at 1 kHz": (
        np.repeat(RELEASED_N, 10), None, np.round(np.repeat(OPEN_AGAIN_M, 10) * 200) / 200, 1000.0
    ),
    "fingers that close further": (LEFT, RIGHT, CLOSING_M),
    "a bump without a movement": (LEFT + BUMP_N, RIGHT + BUMP_N),
    "a bump below the force of a contact": (LEFT + 0.2 * BUMP_N, RIGHT + 0.2 * BUMP_N, CLOSING_M),
    "a soft object": (RELEASED_N, None, SOFT_M),
    "a force that is raised in steps while the gap follows at once": (
        np.where(T_S < 2.7, 1.5 * STAIRS, 0.0) + NOISE_N[0], None,
        np.where(T_S < 2.68, OPEN_AGAIN_M - 0.0005 * STAIRS, OPEN_AGAIN_M),
    ),
    "a quick force that is released": (np.where(T_S < 2.7, QUICK_N, 0.0), None, OPEN_AGAIN_M),
    "a pad that reads a fifth less": (LOW_N, RELEASED_N, OPEN_AGAIN_M),
    "steep steps at a low rate": (RELEASED_N[::5], None, OPEN_AGAIN_M[::5], 20.0),
    "stairs": (STAIRS * (T_S < 2.7) + NOISE_N[0], None, OPEN_AGAIN_M),
    "a sensor that says 0 without a load": (np.where(RELEASED_N < 0.3, 0.0, RELEASED_N), None, OPEN_AGAIN_M),
    "a gap as it was commanded, in steps": (LEFT, RIGHT, STAIRS_M),
    "a coarse gap before a rigid object": (
        np.where(T_S < 2.7, np.clip(T_S - 1.0, 0.0, 0.02) * 300.0, 0.0) + NOISE_N[0], None,
        np.round(np.interp(T_S, [0.0, 1.0, 2.7, 3.0], [0.059, 0.05, 0.05, 0.08]) / 0.00075) * 0.00075,
    ),
    "a release within two samples": (
        spoilt(270, [1.5]), None, np.where(T_S < 2.68, OPEN_AGAIN_M, OPEN_AGAIN_M[np.arange(300) - 4])
    ),
    "noise of one step": (np.round(2.0 * (RELEASED_N + 20.0 * NOISE_N[1])) / 2.0, None, OPEN_AGAIN_M),
    "fast fingers": (
        RELEASED_N, None,
        np.interp(T_S, [0.0, 0.3, 0.34, 1.0, 2.68, 2.7, 3.0], [0.08, 0.08, 0.072, 0.05, 0.05, 0.054, 0.08]),
    ),
}  # fmt: skip


@every_case("case", SOUND)
def test_a_sound_recording_gives_no_notice(case: str) -> None:
    assert noticed(*SOUND[case]) == ()


def test_a_tap_before_the_fingers_move_and_the_last_value_of_a_slow_hold_are_told_apart() -> None:
    tapped = noticed(LEFT + BUMP_N, RIGHT + BUMP_N, np.minimum(CLOSING_M, 0.07))
    assert "comes at 0.31 s" in "".join(tapped)
    # At 2 Hz the last value of a force can be one of the hold.
    slow = np.where(T_S < 2.7, QUICK_N, 0.0)[kept(50)]
    assert not any("sensor stopped" in notice for notice in noticed(slow, gap=OPEN_AGAIN_M))


@every_case("samples", [1, 2, 3])
def test_a_glitch_that_could_pass_for_a_contact_is_noticed(samples: int) -> None:
    glitch = spoilt(30, RELEASED_N[30:][:samples] + 1.0)  # before the contact; a contact is 0.625 N
    (notice,) = noticed(glitch, gap=OPEN_AGAIN_M)
    assert "at 0.3 s" in notice
    # A tap of three samples is a glitch where it takes 30 ms, and none where it takes 300 ms.
    tapped = noticed(glitch, gap=OPEN_AGAIN_M, rate_hz=10.0)
    assert not any("leaves its course" in notice for notice in tapped)


@every_case("every", [1, 10, 20, 50])
@every_case("creeps", [False, True])
def test_a_gap_that_is_slower_than_the_samples_has_not_stopped(every: int, creeps: bool) -> None:
    """50 Hz in a recording of 1000 Hz: each gap of fingers that creep holds for 20 samples.

    After a hold without creep, the first step of an opening at 0.2 m/s is 4 mm, and so is the next one.
    """
    t_s = np.arange(3000) * 0.001
    noise = np.random.default_rng(1).normal(0.0, 0.01, len(t_s))
    if creeps:
        gap = np.where(t_s < 2.46, 0.05 - 0.001 * np.maximum(t_s - 1.0, 0.0), 0.05 + 0.05 * (t_s - 2.46))
        load = np.where((t_s > 1.0) & (t_s < 2.45), np.minimum(t_s - 1.0, 0.5) * 12.0, 0.0)
    else:
        gap = np.maximum(np.maximum(0.08 - 0.03 * np.minimum(t_s, 1.2), 0.0485), 0.0485 + 0.2 * (t_s - 2.5))
        load = np.interp(t_s, [1.0, 1.05, 2.25, 2.5, 2.55], [0.0, 6.0, 5.0, 5.0, 0.0])
    slow = np.arange(3000) // every * every
    if every == 20 or not creeps:
        assert noticed(load + noise, gap=gap[slow], rate_hz=1000.0) == ()
    if not creeps and every == 20:
        # One that had stopped goes on, in the hold, by what it has missed.
        stopped = np.where((t_s >= 0.9) & (t_s < 1.6), gap[900], gap)[slow]
        (notice,) = noticed(load + noise, gap=stopped, rate_hz=1000.0)
        assert "4.5 mm" in notice


@every_case(("rate_hz", "samples"), [(50.0, 4), (20.0, 1), (20.0, 2), (200.0, 8)])
def test_a_glitch_under_a_load_is_noticed_at_any_rate(rate_hz: float, samples: int) -> None:
    t_s = np.arange(0.0, 2.0, 1.0 / rate_hz)
    course = np.interp(t_s, [0.6, 0.9, 1.5, 1.6], [0.0, 9.0, 8.5, 0.0])
    course += np.random.default_rng(2).normal(0.0, 0.01, len(t_s))
    gap = np.interp(t_s, [0.0, 0.6, 0.9, 1.5, 1.7], [0.08, 0.05, 0.0494, 0.0494, 0.06])
    assert noticed(course, gap=gap, rate_hz=rate_hz) == ()
    (notice,) = noticed(spoilt(int(1.1 * rate_hz), [60.0] * samples, course), gap=gap, rate_hz=rate_hz)
    assert "60 N at 1.1 s" in notice


@pytest.mark.slow
@every_case("noise", [0.0, 0.06, 0.1])
@every_case("side", ["left", "right"])
@every_case(("from_s", "until_s"), [(0.0, 9.0), (0.5, 9.0), (1.5, 9.0), (2.0, 9.0), (1.6, 1.65), (2.0, 2.2)])
def test_a_pad_that_feels_nothing_but_noise_while_the_other_is_loaded_is_noticed(
    from_s: float, until_s: float, side: str, noise: float
) -> None:
    """Throughout, or for a moment under a load; in noise, a moment is not told, and a sound pad is not doubted."""
    dead = np.where((from_s <= T_S) & (until_s > T_S), NOISE_N[1], RELEASED_N)
    noise_n = noise * 6.0 * np.random.default_rng(5).normal(0.0, 1.0, (2, len(T_S)))

    def told(pad: Any) -> list[str]:
        pads = (pad, RELEASED_N) if side == "left" else (RELEASED_N, pad)
        both = np.add(pads, noise_n)
        return [notice for notice in noticed(*both, OPEN_AGAIN_M) if "stays at" in notice]

    assert not told(RELEASED_N + NOISE_N[1])
    if noise and until_s < 9.0:
        return
    (notice,) = told(dead)
    assert f"{side} pad stays at" in notice
    assert "the other pad" in notice


SHARES = {
    "half": 0.5,
    "a tenth": 0.1,
    "half from the hold on": np.where(T_S < 2.0, 1.0, 0.5),
    "less and less": np.clip(1.6 - 0.4 * T_S, 0.5, 1.0),
    "exchanged": np.where(T_S < 2.0, 0.6, 1.0 / 0.6),
    "a saturated sensor": np.minimum(1.0, 3.5 / np.maximum(LOAD_N, 0.1)),
}


@pytest.mark.slow
@every_case("share", SHARES)
@every_case("units", [{}, {"force_left": "counts", "force_right": "counts"}])
def test_opposed_pads_that_bear_different_forces_are_noticed(share: str, units: dict[str, str]) -> None:
    """Sensors in counts can be of different kinds, but what one is of the other stays."""

    def told(left: Any, right: Any) -> bool:
        return any("of both" in text for text in noticed(left, right, OPEN_AGAIN_M, **units))

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


@every_case("share", [0.06, 0.2])
@every_case("rate_hz", [50.0, 1000.0])
def test_a_force_whose_single_values_are_wrong_is_noticed(share: float, rate_hz: float) -> None:
    t_s = np.arange(0.0, 3.0, 1.0 / rate_hz)
    force, gap = np.interp(t_s, T_S, RELEASED_N - NOISE_N[0]), np.interp(t_s, T_S, OPEN_AGAIN_M)
    hum = share * 6.0 * np.sin(2.0 * np.pi * 60.0 * t_s + 0.3)
    noise = share * 6.0 * np.random.default_rng(4).normal(0.0, 1.0, len(t_s))
    assert noticed(force, gap=gap, rate_hz=rate_hz) == ()
    for wrong in (force + hum, force + noise):
        assert any("around its course" in notice for notice in noticed(wrong, gap=gap, rate_hz=rate_hz))
    coarse = np.round(force / (share * 6.0)) * share * 6.0
    told = noticed(coarse, gap=gap, rate_hz=rate_hz)
    assert any("has steps of" in notice for notice in told) == (share > 0.1)  # half a step is 3 or 10 %


@every_case("late_s", [0.2, 0.3, 0.5])
def test_a_gap_or_a_force_that_comes_late_is_noticed(late_s: float) -> None:
    late = np.maximum(np.arange(300) - round(100 * late_s), 0)
    squeeze = np.where(T_S < 1.0, OPEN_AGAIN_M, 0.05 - 0.0005 * (RELEASED_N - NOISE_N[0]))
    released = np.where(T_S < 2.3, LOAD_N, 0.0) + NOISE_N[0]
    opened = np.where(T_S < 2.29, squeeze, 0.047 + 0.1 * (T_S - 2.29))
    assert noticed(released, gap=opened) == ()
    for force, gap, says in (
        (released[late], opened, "the force stays"),
        (released, opened[late], "gap come late"),
    ):
        assert any(says in notice for notice in noticed(force, gap=gap))
    # Fingers that are relaxed some time before they open, on something rigid.
    rigid = np.maximum(np.maximum(0.08 - 0.03 * T_S, 0.05), 0.05 + 0.1 * (T_S - 2.29 - late_s))
    assert not any("late" in notice for notice in noticed(released, gap=rigid))


@every_case("since_s", [0.4, 1.5, 2.0])
def test_a_gap_that_jumps_at_a_moderate_speed_is_noticed(since_s: float) -> None:
    """4 mm within 10 ms are no speed that a finger never has, but none gains and loses it in one sample."""
    jumped = OPEN_AGAIN_M + np.where(since_s <= T_S, 0.004, 0.0)
    (notice,) = (text for text in noticed(RELEASED_N, gap=jumped) if "the gap jumps" in text)
    assert "within 10 ms" in notice


def filtered(t_s: Any, signal: Any, seconds: float) -> Any:
    """Return what a filter of first order with this time constant gives while a signal is recorded."""
    share, state, course = 1.0 - np.exp(-t_s[1] / seconds), 0.0, []
    for value in signal.tolist():
        state += share * (value - state)
        course.append(state)
    return np.array(course)


@every_case("rate_hz", [50.0, 500.0])
@every_case("object_", ["linear", "hardens", "relaxes"])
def test_a_force_that_grows_while_the_fingers_rest_is_told(rate_hz: float, object_: str) -> None:
    """Of a drive that slows down little by little, where nothing turns at once."""
    t_s = np.arange(0.0, 3.0, 1.0 / rate_hz)
    rng = np.random.default_rng(3)
    pressed = 0.004 * (1.0 - np.exp(-np.clip(t_s - 1.0, 0.0, None) / 0.1))
    force = {
        "linear": 1500.0 * pressed,
        "hardens": 9e7 * pressed**3,
        "relaxes": 2500.0 * pressed - 1000.0 * filtered(t_s, pressed, 0.3),
    }[object_] + rng.normal(0.0, 0.01, len(t_s))
    gap = np.where(t_s < 1.0, 0.05 + 0.04 * (1.0 - t_s), 0.05 - pressed)
    for gap_m in (gap, np.round(gap, 4), gap + rng.normal(0.0, 5e-6, len(t_s))):
        assert noticed(force, gap=gap_m, rate_hz=rate_hz) == ()
    told = noticed(filtered(t_s, force, 0.3), gap=gap, rate_hz=rate_hz)
    assert ["the fingers rest" in text for text in told] == [True] * (object_ != "relaxes")
    # Where the gap moves by less than its steps, it tells of no rest.
    coarse = noticed(filtered(t_s, force, 0.3), gap=np.round(gap, 2), rate_hz=rate_hz)
    assert not any("the fingers rest" in text for text in coarse)
