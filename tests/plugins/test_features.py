"""The six features of Table I: their definitions, and a defined answer for every degenerate trace."""

import math

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from traces import made_trace

from graspsense.core.components.compiled_features import compiled_extraction
from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import SI_UNITS
from graspsense.plugins.features.chitta import NAMES, ChittaConfig, ChittaFeatures

FEATURES = ChittaFeatures(ChittaConfig())


def squeeze(approach_ticks=100, during=400, after=200, p0=0.0600, p1=0.0540, f0=0.625, f1=8.0):
    """Contact after `before` ticks, a straight squeeze of `during` ticks from p0 to p1, then rest."""
    rows = [(p0 + 1e-5 * (approach_ticks - k), 0.0, 0.0) for k in range(approach_ticks)]
    rows += [
        (p0 + (p1 - p0) * k / during, f0 + (f1 - f0) * k / during, f0 + (f1 - f0) * k / during)
        for k in range(during)
    ]
    return rows + [(p1, f1, f1)] * after


def test_the_six_features_of_a_straight_squeeze():
    f = FEATURES.extract(made_trace(squeeze()))
    assert (f.names, f.units) == (NAMES, ("m", "m", "N", "s", "m/s", "N/s"))
    assert not f.reasons
    # Rest begins where the remaining way is within tau_2 times its window: 5 um before the end, at 15 mm/s.
    assert (f["p_first"], f["p_steady"]) == (pytest.approx(0.0600), pytest.approx(0.0540, abs=2e-5))
    assert (f["f_steady"], f["delta_t"]) == (pytest.approx(8.0), pytest.approx(0.4, abs=0.0021))
    assert f["dp_dt"] == pytest.approx((f["p_steady"] - f["p_first"]) / f["delta_t"])
    assert f["df_dt"] == pytest.approx((8.0 - 0.625) / f["delta_t"])
    frames = FEATURES.extract(made_trace(squeeze(), units={**SI_UNITS, "t": "frame"}))
    assert frames.units == ("m", "m", "N", "frame", "m/frame", "N/frame")


def test_contact_counts_only_once_both_fingers_touch():
    rows = squeeze()
    # The left finger alone, long before: no contact yet.
    rows[:100] = [(gap, 3.0, 0.0) for gap, _, _ in rows[:100]]
    assert FEATURES.extract(made_trace(rows))["p_first"] == pytest.approx(0.0600)


@every_case(
    ("choice", "expected"), [("mean", 5.0), ("left", 4.0), ("right", 6.0), ("min", 4.0), ("sum", 10.0)]
)
def test_which_force(choice, expected):
    rows = [(0.06, 0.0, 0.0)] * 5 + [(0.06, 4.0, 6.0)] * 100
    rows[5] = (0.061, 4.0, 6.0)
    f = ChittaFeatures(ChittaConfig(force=choice)).extract(made_trace(rows))
    assert f["f_steady"] == expected


def missing_of(trace):
    f = FEATURES.extract(trace)
    assert f.names == NAMES
    missing = {name for name, value in zip(f.names, f.values, strict=True) if value != value}
    assert missing == set(f.reasons)
    return missing, f.reasons


RISES = [(0.06 - 1e-5 * k, 5.0, 5.0) for k in range(500)]
TOUCHED = [(0.06, 9.0, 9.0)]


@every_case(
    ("rows", "missing", "why"),
    [
        ([], set(NAMES), "empty"),
        ([(0.06, 0.0, 0.0)] * 50, set(NAMES), "no finger felt"),
        ([(0.06, 9.0, 0.0)] * 50, set(NAMES), "left pad"),
        ([(0.06, 0.0, 9.0)] * 50, set(NAMES), "right pad"),
        ([(0.06, 9.0, 0.0)] * 25 + [(0.06, 0.0, 9.0)] * 25, set(NAMES), "same time"),
        ([(0.06, math.nan, math.nan)] * 50, set(NAMES), "no finger felt"),
        # A contact without rest, way, gap or force.
        (RISES, set(NAMES) - {"p_first"}, "not at rest"),
        ([(0.03, 9.0, 9.0)] * 100, {"dp_dt", "df_dt"}, "delta_t is zero"),
        (TOUCHED * 10 + [(math.nan, 9.0, 9.0)] * 500, set(NAMES) - {"p_first"}, "not at rest"),
        (TOUCHED * 5 + [(0.059, math.nan, math.nan)] * 100, {"f_steady", "df_dt"}, "no number"),
    ],
)
def test_what_a_trace_does_not_show_is_missing_with_the_reason(rows, missing, why):
    without, reasons = missing_of(made_trace(rows))
    assert without == missing
    assert all(why in reason for reason in reasons.values())


def test_the_release_is_no_part_of_the_squeeze():
    rows = RISES[:100] + [(0.059, 5.0, 5.0)] * 100
    phases = [Phase.SQUEEZE] * 100 + [Phase.RELEASE] * 100
    assert missing_of(made_trace(rows, phases=phases))[0] == set(NAMES) - {"p_first"}
    # Too wide: both pads are felt in the very tick that turns to release.
    trace = made_trace([(0.06, 0.0, 0.0)] * 5 + TOUCHED, phases=[Phase.APPROACH] * 5 + [Phase.RELEASE])
    missing, reasons = missing_of(trace)
    assert missing == set(NAMES)
    assert "grasp had ended" in reasons["p_first"]


def test_until_is_a_trace_of_what_had_been_seen_by_then():
    trace = made_trace(squeeze())
    early = trace.until(0.2)
    assert (len(early), early.t_s[-1] <= 0.2) == (201, True)
    assert (len(trace.until(-1.0)), len(trace.until(1e9))) == (0, len(trace))
    assert np.array_equal(early.gap_m, trace.gap_m[:201])
    assert early.pad_left.shape == (0, 0), "no image says how many cells there are"


def test_a_set_with_another_extract_is_not_extracted_by_the_compiled_form_of_its_base():
    class Doubled(ChittaFeatures):
        def extract(self, trace):
            whole = super().extract(trace)
            return evolve(whole, values=tuple(2.0 * value for value in whole.values))

    assert compiled_extraction(FEATURES.extract) is not None
    assert compiled_extraction(Doubled(ChittaConfig()).extract) is None


@every_case("seed", range(20))
def test_a_held_grasp_has_the_same_features_without_its_release(seed):
    rng = np.random.default_rng(seed)
    n = 400
    gaps = 0.06 - 1e-7 * np.cumsum(rng.integers(0, 60, n) * (rng.random(n) < 0.2))
    gaps[rng.random(n) < 0.002] = math.nan
    forces = np.where(np.arange(n) > 40, rng.normal(2.0, 1.0, (2, n)), 0.0)
    phases = np.sort(rng.integers(int(Phase.APPROACH), int(Phase.RELEASE) + 1, n))
    trace = made_trace(np.column_stack((gaps, *forces)), phases=phases)
    held = trace.until(float(trace.t_s[np.flatnonzero(trace.phase == Phase.RELEASE)[0]]))
    for choice in ("mean", "left", "right", "min", "sum"):
        features = ChittaFeatures(ChittaConfig(force=choice, rest_window_s=0.02))
        extracted = features.extract(trace)
        unreleased = features.extract(held)
        assert (repr(unreleased.values), unreleased.reasons) == (repr(extracted.values), extracted.reasons)


@every_case(
    ("rows", "why"),
    [
        ([(0.06 - 1e-4 * k, 5.0, 5.0) for k in range(150)], "not at rest within the 0.099 s"),
        ([(0.06, 0, 5)] * 100 + [(0.05, 0, 0)] * 20 + [(0.05, 5, 5)] * 30, "right pad felt"),
    ],
)
def test_a_held_grasp_without_rest_or_contact_has_the_same_reasons_without_its_release(rows, why):
    phases = [Phase.SQUEEZE] * 50 + [Phase.HOLD] * 50 + [Phase.RELEASE] * 50
    whole = missing_of(made_trace(rows, phases=phases))
    assert whole == missing_of(made_trace(rows[:101], phases=phases[:101]))
    assert any(why in reason for reason in whole[1].values())


def test_open_fingers_at_rest_after_the_release_of_a_recording_are_no_rest_of_the_squeeze():
    """A recording of another program goes on after the release, which no phase tells."""
    moving = squeeze(after=0)
    opening = [(0.0540 + 1e-4 * k, max(8.0 - 0.2 * k, 0.0), max(8.0 - 0.2 * k, 0.0)) for k in range(200)]
    trace = made_trace(moving + opening + [(0.0740, 0.0, 0.0)] * 400)
    extracted = FEATURES.extract(trace)
    assert math.isnan(extracted["f_steady"])
    # A force below that of a contact is one of a hold, where the fingers have not opened.
    weak = FEATURES.extract(made_trace(moving + [(0.0540, 0.3, 0.3)] * 200))
    assert weak["f_steady"] == 0.3


def course(t_s, gap, force, step_m=0.0, measured_hz=1e9, told_s=None):
    """A trace at these times; gap and force are times and values, the gap in steps, and measured so often."""
    seen = np.floor(t_s * measured_hz + 1e-6) / measured_hz
    gap_m = np.interp(seen, *gap)
    gap_m = np.round(gap_m / step_m) * step_m if step_m else gap_m
    force_n = np.interp(t_s, *force)
    rows = np.column_stack((gap_m, force_n, force_n))
    return FEATURES.extract(made_trace(rows, dt=t_s[1] - t_s[0], t_s=t_s if told_s is None else told_s))


def coarse_squeeze(rate_hz, step_m, hold_s, measured_hz=1e9):
    """Closing at 8 mm/s, a squeeze of 2.4 mm to 8 N in 3 s, and a hold."""
    gap, force = ([0.0, 1.5, 4.5], [0.076, 0.064, 0.0616]), ([1.5, 4.5], [0.0, 8.0])
    return course(np.arange(0.0, 4.5 + hold_s, 1.0 / rate_hz), gap, force, step_m, measured_hz)


def slow_squeeze(t_s, told_s=None):
    """The gap closes by 1.6 mm/s and rests at 0.0460 m from 3.5 s on."""
    return course(t_s, ([0.0, 1.0, 3.5], [0.08, 0.05, 0.046]), ([1.0, 3.5], [0.0, 6.0]), told_s=told_s)


@every_case("rate_hz", [10.0, 45.0, 1000.0])
@every_case("step_m", [5e-5, 1e-4, 2e-4])
def test_a_coarse_gap_that_repeats_a_number_is_not_at_rest(rate_hz, step_m):
    f = coarse_squeeze(rate_hz, step_m, hold_s=3.0)
    assert f["f_steady"] == pytest.approx(8.0)
    # The gap moves by a step within its resolution: at 0.8 mm/s, two steps are told apart.
    assert f["delta_t"] == pytest.approx(2.77, abs=0.1 + 2 * step_m / 8e-4)


def test_a_gap_that_is_measured_less_often_than_its_rows_is_not_at_rest_between():
    assert coarse_squeeze(1000.0, 0.0, 1.5, measured_hz=10.0)["f_steady"] == pytest.approx(8.0)


@every_case(("step_m", "hold_s"), [(1e-4, 0.0), (1e-4, 0.5), (1e-3, 3.0)])
def test_a_rest_that_a_coarse_gap_cannot_show_is_said_to_be_unresolved(step_m, hold_s):
    f = coarse_squeeze(45.0, step_m, hold_s)
    assert f["p_first"] == pytest.approx(0.064, abs=1e-3)
    assert math.isnan(f["f_steady"])
    assert "rest not resolved" in f.reasons["f_steady"]


@every_case(("jump_s", "end_s"), [(0.0, 5.0), (0.15, 5.0), (0.5, 5.0), (0.15, 3.0)])
def test_a_clock_that_was_set_within_a_squeeze_shows_no_rest(jump_s, end_s):
    """Where the recording ends before the rest, there is none."""
    times = np.arange(0.0, end_s, 0.01)
    f = slow_squeeze(times, times + np.where(times > 1.8, jump_s, 0.0))
    rests = end_s == 5.0
    assert f["f_steady"] == pytest.approx(6.0 if rests else math.nan, abs=0.05, nan_ok=True)
    assert ("clock" in f.reasons.get("f_steady", "")) == (not rests)


def test_a_hole_in_a_rest_is_a_part_of_it():
    times = np.arange(0.0, 5.0, 0.01)
    f = slow_squeeze(times[(times < 3.6) | (times > 4.0)])
    assert (f["f_steady"], f["delta_t"]) == (pytest.approx(6.0), pytest.approx(2.2, abs=0.1))


@every_case(("rate_hz", "seen"), [(10.0, False), (45.0, True), (1000.0, True)])
def test_a_contact_between_two_samples_is_said_to_be_unresolved(rate_hz, seen):
    """A squeeze of 60 ms: at 10 Hz nothing tells when it began."""
    gap, force = ([0.0, 1.53, 1.59], [0.08, 0.06, 0.058]), ([1.53, 1.59], [0.0, 8.0])
    f = course(np.arange(0.0, 4.0, 1.0 / rate_hz), gap, force)
    assert (f["f_steady"], f["p_steady"]) == (pytest.approx(8.0), pytest.approx(0.058, abs=1e-4))
    assert math.isfinite(f["delta_t"]) == seen
    unresolved = {name for name, reason in f.reasons.items() if "contact not resolved" in reason}
    assert unresolved == (set() if seen else {"delta_t", "dp_dt", "df_dt"})
