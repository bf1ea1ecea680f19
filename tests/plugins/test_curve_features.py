"""Features of the whole force curve: laws that hold for every curve, and figures of real recordings."""

import math
import os

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from hypothesis import example, given, settings
from hypothesis import strategies as st
from traces import made_trace

from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import SI_UNITS
from graspsense.plugin_api import create
from graspsense.plugins.features.curve import NAMES, CurveConfig, CurveFeatures
from graspsense.sources.recordings.icub_dataset import read_dataset

FEATURES = CurveFeatures(CurveConfig())
HOLD_NAMES = {"relaxation", "relaxation_time", "creep", "hold_t25", "hold_t50", "hold_t75"}
RELEASE_NAMES = {
    "hysteresis",
    "residual_compression",
    "unloading_stiffness",
    "release_x75",
    "release_x50",
    "release_x25",
}


def grasp(
    t_s, stiffness=4000.0, exponent=1.0, relaxing=0.2, tau_s=0.08, second_share=0.9, noise=0.0, units=SI_UNITS
):
    """A grasp sampled at these times: touch at 0.5 s, 4 mm of squeeze until 1 s, hold until 1.6 s, release until 2.2 s.

    The force is that of a spring, F = k d (x / d)^n with the depth d = 4 mm, which loses a share in the hold. The
    right pad has a share of that of the left.
    """
    t_s = np.asarray(t_s, dtype=np.float64)
    gap = np.interp(t_s, [0.0, 0.5, 1.0, 1.6, 2.2], [0.065, 0.060, 0.056, 0.056, 0.066])
    x = np.maximum(0.060 - gap, 0.0)
    lost = np.where(t_s > 1.0, relaxing * (1.0 - np.exp(-(t_s - 1.0) / tau_s)), 0.0)
    left = stiffness * 0.004 * (x / 0.004) ** exponent * (1.0 - lost)
    pads = np.column_stack((left, second_share * left))
    pads += noise * np.random.default_rng(3).normal(size=pads.shape)
    later = [t_s < 0.5, t_s < 1.0, t_s < 1.6]
    phases = np.select(later, [Phase.APPROACH, Phase.SQUEEZE, Phase.HOLD], Phase.RELEASE)
    return made_trace(np.column_stack((gap, pads)), phases=phases, units=units, t_s=t_s)


EVEN = np.arange(0.0, 2.2, 0.001)


def defined(features):
    return {name for name, value in zip(features.names, features.values, strict=True) if value == value}


STIFFNESSES = ("stiffness_25", "stiffness_50", "stiffness_75")


def assert_close(features, expected, names, rel, least=0.0):
    for name in names:
        assert features[name] == pytest.approx(expected[name], rel=rel, abs=least), name


def test_a_spring_with_known_constants():
    f = FEATURES.extract(grasp(EVEN))
    assert not f.reasons
    # The mean of both pads has 0.95 of the stiffness of the left one.
    assert [f[name] for name in STIFFNESSES] == pytest.approx([3800.0] * 3, rel=1e-3)
    assert f["curvature"] == pytest.approx(0.0, abs=2e-3)
    # The largest force is a mean over 50 ms, so a loss that begins at once is seen by so much later.
    assert f["relaxation"] == pytest.approx(0.2, rel=0.15)
    assert f["relaxation_time"] == pytest.approx(0.08, rel=0.2)
    assert f["unloading_stiffness"] == pytest.approx(0.8 * 3800.0, rel=1e-3)
    # The release returns 80 % of the work, but for the triangle between no force and contact at either end.
    assert f["hysteresis"] == pytest.approx(0.2, abs=0.01)
    # The first pad to touch, and to let go, has the share 0.9: 0.625 N of 3600 N/m.
    assert f["contact_gap"] == pytest.approx(0.060 - 0.625 / 3600.0, abs=1e-6)
    assert f["pad_difference"] == pytest.approx(0.1 / 1.9)
    units = dict(
        zip(f.names, FEATURES.extract(grasp(EVEN, units={**SI_UNITS, "t": "frame"})).units, strict=True)
    )
    assert [units[name] for name in ("loading_work", "loading_time", "stiffness_50")] == ["J", "frame", "N/m"]


@every_case(("exponent", "stiffens"), [(1.5, True), (2.0, True), (0.7, False)])
def test_curvature_and_stiffness_agree_on_what_stiffens(exponent, stiffens):
    f = FEATURES.extract(grasp(EVEN, exponent=exponent))
    assert (f["stiffness_75"] > 1.1 * f["stiffness_25"]) == (f["curvature"] > 0.05) == stiffens
    # The slope of k d (x/d)^n at half of the largest force: n k (1/2)^(1 - 1/n).
    expected = exponent * 3800.0 * 0.5 ** (1.0 - 1.0 / exponent)
    assert f["stiffness_50"] == pytest.approx(expected, rel=0.05)


def uneven_times(seed, n):
    """Return about n times of a grasp, whose density varies by a factor of ten."""
    rng = np.random.default_rng(seed)
    density = np.interp(EVEN, np.linspace(0.0, 2.2, 8), rng.uniform(0.1, 1.0, 8))
    share = np.cumsum(density) / density.sum()
    uneven = np.interp((np.arange(n) + rng.uniform(0.0, 1.0, n)) / n, share, EVEN)
    return np.unique(np.concatenate(([0.0], uneven, [EVEN[-1]])))


SCALE = {"curvature": 1.0, "residual_compression": 0.004, "creep": 0.004, "hysteresis": 1.0}
"""The size of features that may be zero."""


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([800, 1500]), st.sampled_from([0.7, 1.0, 1.8]))
def test_uneven_samples_of_the_same_curve_give_the_same_features(seed, n, exponent):
    """With samples closer than the window of the mean force, what they leave out of the curve is small."""
    even = FEATURES.extract(grasp(EVEN, exponent=exponent))
    other = FEATURES.extract(grasp(uneven_times(seed, n), exponent=exponent))
    assert defined(other) == defined(even) == set(NAMES)
    for name in NAMES:
        rel = 0.15 if name == "relaxation_time" else 0.06
        assert other[name] == pytest.approx(even[name], rel=rel, abs=0.02 * SCALE.get(name, 0.0)), name


def with_samples_between(trace, t_s):
    """Return the trace with samples at further times, on the straight lines between its own."""
    t_s = np.union1d(trace.t_s, t_s[(t_s > trace.t_s[0]) & (t_s < trace.t_s[-1])])
    columns = [
        np.interp(t_s, trace.t_s, own) for own in (trace.gap_m, trace.force_left_n, trace.force_right_n)
    ]
    phases = trace.phase[np.searchsorted(trace.t_s, t_s)]
    return made_trace(np.column_stack(columns), phases=phases, units=trace.units, t_s=t_s)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.7, 1.0, 1.8]))
@example(956894, 1.8)
@example(332562459, 0.7)
def test_samples_on_the_lines_between_sparse_ones_change_little(seed, exponent):
    """Force and gap are linear between samples, so no stretch has more weight because it has more samples.

    The curve itself is no reference for 400 samples. They are up to 40 ms apart, and no feature can know a peak that
    lies between two of them: the one of the first example is 1.2 % lower, which is 7 % of the relaxation.
    """
    trace = grasp(uneven_times(seed, 400), exponent=exponent)
    sparse, dense = FEATURES.extract(trace), FEATURES.extract(with_samples_between(trace, EVEN))
    assert defined(dense) == defined(sparse)
    # The largest mean force is taken at a sample: its time, and with it the loading, is known to their distance.
    step_s = float(np.diff(trace.t_s).max())
    scale = {**SCALE, "relaxation": 1.0}
    for name in defined(sparse):
        allowed = step_s if name == "relaxation_time" else 0.04 * scale.get(name, abs(sparse[name]))
        assert dense[name] == pytest.approx(sparse[name], rel=0.0, abs=allowed), name


def test_repeated_forces_between_cell_images_do_not_shift_the_curve():
    """Forces that come every 41 ms and are repeated in between are not paired with the gaps in between."""
    trace = grasp(EVEN)
    held = (np.arange(len(EVEN)) // 41) * 41
    repeated = evolve(trace, force_left_n=trace.force_left_n[held], force_right_n=trace.force_right_n[held])
    stairs, even = FEATURES.extract(repeated), FEATURES.extract(trace)
    assert_close(stairs, even, (*STIFFNESSES, "contact_gap", "unloading_stiffness"), rel=0.02)
    assert stairs["hysteresis"] == pytest.approx(even["hysteresis"], abs=0.03)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_features_scale_with_their_units(length, force, time):
    """In other units of gap, force and time, each feature is the same quantity."""
    trace = grasp(EVEN[::4], exponent=1.3)
    scaled = evolve(
        trace,
        t_s=trace.t_s * time,
        gap_m=trace.gap_m * length,
        force_left_n=trace.force_left_n * force,
        force_right_n=trace.force_right_n * force,
    )
    config = CurveConfig(contact_force_n=0.625 * force, window_s=0.05 * time, least_travel_m=2e-5 * length)
    factors = {"1": 1.0, "m": length, "N": force, "s": time, "J": force * length, "N/m": force / length}
    plain, converted = FEATURES.extract(trace), CurveFeatures(config).extract(scaled)
    for name, unit in zip(NAMES, plain.units, strict=True):
        expected = pytest.approx(plain[name] * factors[unit], rel=1e-6, abs=1e-9 * factors[unit])
        assert converted[name] == expected, name


def test_a_rise_of_few_samples_tells_no_contact_and_a_force_that_stays_is_measured_again():
    few, some, dense = (
        FEATURES.extract(grasp(np.arange(0.01, 2.2, step_s), relaxing=0.0)) for step_s in (0.2, 0.03, 0.001)
    )
    assert {"compression", "stiffness_50", "load_x25"} <= set(few.reasons)
    assert "in the rise" in few.reasons["contact_gap"]
    assert_close(some, dense, ("contact_gap", "compression", "loading_time", "stiffness_50"), rel=0.1)


def test_noise_of_the_pads_does_not_bias_stiffness_and_force():
    quiet, noisy = FEATURES.extract(grasp(EVEN)), FEATURES.extract(grasp(EVEN, noise=0.3))
    assert noisy["peak_force"] == pytest.approx(quiet["peak_force"], rel=0.02)
    assert_close(noisy, quiet, (*STIFFNESSES, "loading_work", "unloading_stiffness"), rel=0.08)


def test_a_grasp_without_hold_or_release_lacks_only_their_features():
    squeezed, held = (FEATURES.extract(grasp(EVEN).until(t_s)) for t_s in (1.0, 1.5))
    assert defined(squeezed) == set(NAMES) - HOLD_NAMES - RELEASE_NAMES
    assert "no hold" in squeezed.reasons["relaxation"]
    assert defined(held) == set(NAMES) - RELEASE_NAMES
    assert "before the release" in held.reasons["hysteresis"]
    assert_close(squeezed, held, ("stiffness_50", "contact_gap", "curvature"), rel=0.05, least=0.01)


def test_a_recording_without_phases_has_the_same_features():
    trace = grasp(EVEN)
    without = FEATURES.extract(evolve(trace, phase=np.full(len(trace), int(Phase.APPROACH))))
    assert defined(without) == set(NAMES)
    assert_close(without, FEATURES.extract(trace), set(NAMES) - {"creep"}, rel=0.08, least=0.02)


@every_case("absent", [math.nan, 0.0])
def test_a_single_pad_suffices(absent):
    """The other pad gives no number, or touches nothing."""
    both = grasp(EVEN, second_share=1.0)
    f = FEATURES.extract(evolve(both, force_right_n=np.full(len(both), absent)))
    assert set(f.reasons) == {"pad_difference"}
    assert_close(f, FEATURES.extract(both), set(NAMES) - {"pad_difference"}, rel=1e-6)
    nothing = FEATURES.extract(
        evolve(both, force_left_n=0.0 * EVEN, force_right_n=np.full(len(both), absent))
    )
    assert "never felt 0.625 N" in nothing.reasons["peak_force"]


def test_a_rigid_object_has_forces_but_no_stiffness():
    trace = grasp(EVEN)
    f = FEATURES.extract(evolve(trace, gap_m=np.maximum(trace.gap_m, 0.05999)))
    assert {"peak_force", "loading_time", "relaxation", "load_t50"} <= defined(f)
    assert "below least_travel_m" in f.reasons["stiffness_50"]


NUMBERS = st.floats(-1.0, 100.0) | st.just(math.nan)
TIMES, PHASES = st.sampled_from([0.0, 0.001, 0.03]), st.sampled_from([int(phase) for phase in Phase])


@given(
    st.lists(
        st.tuples(st.floats(0.0, 0.09) | st.just(math.nan), NUMBERS, NUMBERS, TIMES, PHASES), max_size=60
    )
)
def test_every_trace_gives_numbers_or_reasons(rows):
    times, phases = np.cumsum([row[3] for row in rows]), [row[4] for row in rows]
    f = FEATURES.extract(made_trace([row[:3] for row in rows], phases=phases, t_s=times))
    for name, value in zip(f.names, f.values, strict=True):
        assert not math.isinf(value)
        assert (value != value) == bool(f.reasons.get(name)), name


@pytest.mark.slow
@pytest.mark.skipif(
    "GRASPSENSE_ICUB" not in os.environ, reason="GRASPSENSE_ICUB names no folder of recordings"
)
def test_most_features_of_the_icub_recordings_are_defined_where_there_is_contact():
    table = read_dataset(os.environ["GRASPSENSE_ICUB"], create("feature-set", "graspsense/curve")).table
    known = ~np.isnan(table.values)
    touched = known.any(axis=1)
    # Table I needs both pads and rest: 133 grasps have any of its features, 96 all of them.
    assert (len(table), int(touched.sum())) == (203, 166)
    before_release = [name not in RELEASE_NAMES for name in table.names]
    assert known[touched][:, before_release].mean() > 0.8
    assert not known[:, np.logical_not(before_release)].any(), "the recordings end before the release"
