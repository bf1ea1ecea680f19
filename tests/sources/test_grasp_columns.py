"""Columns of a grasp: channels with times of their own, and shapes and lengths that are checked by name."""

from math import isnan

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.trace import trace_of
from graspsense.plugin_api import GraspColumns, checked_recording
from graspsense.sources.columns.grasp_columns import without_missing

N = 100


def columns(**more):
    t_s = np.arange(N) * 0.01
    force_n = np.linspace(0.0, 5.0, N)
    return GraspColumns(
        source="jar.csv", t_s=t_s, gap_m=0.06 - 0.01 * t_s, left_n=force_n, right_n=force_n, **more
    )


def trace(recording):
    readings = recording.readings
    frames = [reading.frame for reading in readings]
    return trace_of(
        frames, [2] * len(frames), [0.0] * len(frames), [], signals=[tick.signals for tick in readings]
    )


def test_a_fast_channel_with_its_own_times_keeps_every_sample_axis_and_time():
    times_s = np.arange(0.003, 0.95, 1.0 / 330.0)
    values = np.column_stack([np.arange(len(times_s)), np.full(len(times_s), -1.0), times_s])
    given_ = columns(arrays={"imu": values}, fast=frozenset({"imu"}), times={"imu": times_s})
    recording = checked_recording(given_)
    (channel,) = recording.channels
    assert channel.axes == ("x", "y", "z")
    assert channel.rate_hz == pytest.approx(330.0, rel=1e-6)
    assert channel.samples == 4  # 3.3 a tick
    imu = trace(recording).signals["imu"]
    assert np.array_equal(imu.values, values)
    assert imu.t_s == pytest.approx(times_s, abs=1e-6)
    assert imu.lost == 0


def test_images_and_numbers_with_their_own_times_hold_until_the_next():
    times_s = np.array([0.2, 0.4001, 0.9])
    cells = np.arange(18.0).reshape(3, 6)
    given_ = columns(
        arrays={"palm": cells},
        scalars={"heat": np.array([300.0, 301.0, 302.0])},
        shapes={"palm": (2, 3)},
        times={"palm": times_s, "heat": times_s},
        units={"heat": "K"},
    )
    recording = checked_recording(given_)
    signals = [reading.signals for reading in recording.readings]
    assert [channel.name for channel in recording.channels] == ["heat", "palm"]
    assert (recording.channels[1].rows, recording.channels[1].columns) == (2, 3)
    assert isnan(signals[19].heat)
    assert (signals[20].heat, signals[40].heat, signals[41].heat, signals[99].heat) == (300, 300, 301, 302)
    assert [signals[k].palm.counter for k in (19, 20, 40, 41, 99)] == [0, 1, 1, 2, 3]
    assert signals[41].palm.t_s == 0.4001
    assert np.array_equal(trace(recording).signals["palm"].cells, cells)


@given(st.lists(st.floats(0.0, 0.99), min_size=1, max_size=60, unique=True), st.integers(1, 4))
def test_no_sample_within_the_grasp_is_lost(times, axes):
    sampled_s = np.array(sorted(times))
    values = np.arange(len(sampled_s) * axes, dtype=float).reshape(len(sampled_s), axes)
    given_ = columns(arrays={"imu": values}, fast=frozenset({"imu"}), times={"imu": sampled_s})
    assert np.array_equal(trace(checked_recording(given_)).signals["imu"].values, values)


def test_samples_outside_of_the_grasp_are_left_out_and_counted():
    sampled_s = np.arange(-0.5, 1.5, 0.01)
    given_ = columns(
        arrays={"imu": np.ones((len(sampled_s), 3))}, fast=frozenset({"imu"}), times={"imu": sampled_s}
    )
    recording = checked_recording(given_)
    (note,) = [note for note in recording.notes if "imu" in note]
    left_out = len(sampled_s) - len(trace(recording).signals["imu"].t_s)
    assert note.startswith(f"{left_out} samples of imu")
    assert left_out == pytest.approx(100, abs=2)


@pytest.mark.parametrize(("shape", "samples", "axes"), [((1, 3), 1, 3), ((3, 1), 3, 1)])
def test_numbers_of_a_fast_channel_are_axes_or_samples_as_shapes_says(shape, samples, axes):
    values = np.arange(3.0 * N).reshape(N, 3)
    with pytest.raises(DataDamaged, match=r"jar.csv.*'imu'.*axes or samples.*shapes"):
        checked_recording(columns(arrays={"imu": values}, fast=frozenset({"imu"})))
    given_ = columns(arrays={"imu": values}, fast=frozenset({"imu"}), shapes={"imu": shape})
    (channel,) = checked_recording(given_).channels
    assert (channel.samples, len(channel.axes), channel.rate_hz) == (
        samples,
        axes,
        pytest.approx(100.0 * samples),
    )


LONG = np.ones(N + 1)


@every_case(
    ("more", "says"),
    [
        ({"left_n": LONG}, "'left_n' has 101 samples, and t_s has 100"),
        ({"velocity_m_s": np.ones((N, 2))}, "'velocity_m_s'.*shape"),
        ({"arrays": {"palm": np.ones((N + 1, 6))}}, "'palm' has 101"),
        ({"arrays": {"palm": np.ones(N)}}, "'palm'.*shape"),
        ({"arrays": {"palm": np.ones((N, 6))}, "shapes": {"palm": (2, 2)}}, "'palm' has 6 numbers a sample.*2 x 2"),
        ({"scalars": {"two words": np.ones(N)}}, "'two words'"),
        ({"arrays": {"palm": np.ones((N, 0))}}, "'palm'"),
        ({"fast": frozenset({"imu"})}, "'imu'.*`arrays`"),
        ({"times": {"imu": LONG}}, "'imu', which is neither"),
        ({"scalars": {"heat": np.ones(3)}, "times": {"heat": np.array([0.1, 0.1, 0.2])}}, "times of 'heat'.*sample 2"),
        ({"scalars": {"heat": np.ones(3)}, "times": {"heat": np.array([0.1, 0.2])}}, "'heat' has 3 samples.*`times`"),
        ({"scalars": {"heat": np.ones(2)}, "times": {"heat": np.array([2e3, 3e3])}}, "times of 'heat'.*seconds"),
        (
            {"arrays": {"imu": np.ones((5, 3))}, "fast": frozenset({"imu"}), "shapes": {"imu": (1, 4)},
             "times": {"imu": np.linspace(0.1, 0.5, 5)}},
            "'imu' has 3 numbers",
        ),
    ],
)  # fmt: skip
def test_lengths_and_shapes_are_errors_with_names(more, says):
    with pytest.raises(DataDamaged, match=f"(?s)jar.csv: .*{says}"):
        checked_recording(evolve(columns(), **more))


def test_a_part_of_the_samples_takes_the_part_of_each_channel():
    times_s = np.arange(0.0, 0.99, 0.002)
    given_ = columns(
        arrays={"imu": np.column_stack([times_s, times_s])}, fast=frozenset({"imu"}), times={"imu": times_s}
    ).rows(slice(20, 40), "squeeze 1")
    imu = trace(checked_recording(given_)).signals["imu"].values[:, 0]
    assert (imu[0], imu[-1]) == (pytest.approx(0.2, abs=2e-3), pytest.approx(0.39, abs=2e-3))


def topics_in_one_table(*, force_until_s=9.0, force_late_s=0.001):
    """Return a table with rows of the gap alone and of the force alone, as an export of topics writes it."""
    t_s = np.arange(N) * 0.01
    force_s = t_s[t_s < force_until_s] + force_late_s
    order = np.argsort(np.concatenate((t_s, force_s)), kind="stable")
    nothing = np.full(len(force_s), np.nan)
    force_n = np.concatenate((np.full(N, np.nan), 5.0 * force_s))[order]
    gap_m = np.concatenate((0.06 - 0.01 * t_s, nothing))[order]
    times = np.concatenate((t_s, force_s))[order]
    return GraspColumns(source="bag.csv", t_s=times, gap_m=gap_m, left_n=force_n, right_n=force_n)


def test_gap_and_force_with_rows_of_their_own_hold_their_last_values():
    frames = [reading.frame for reading in checked_recording(topics_in_one_table()).readings]
    assert len(frames) == N - 1  # the first row of the gap has no force yet
    # The force of each row of the gap is that of 9 ms before.
    assert [frame.force_left_n for frame in frames] == pytest.approx([5.0 * (f.t_s - 0.009) for f in frames])
    # Equal times are of one moment.
    assert len(checked_recording(topics_in_one_table(force_late_s=0.0)).readings) == N
    # All rows of the gap, and then all rows of the force.
    table = topics_in_one_table()
    blocks = checked_recording(table.rows(np.argsort(np.isnan(table.gap_m), kind="stable")))
    assert [reading.frame for reading in blocks.readings] == frames


def test_a_force_that_ends_before_the_gap_is_not_held_to_the_end():
    kept = without_missing(topics_in_one_table(force_until_s=0.5))
    assert kept.t_s[-1] <= 0.511
    assert len(kept.warnings) == 1
    with pytest.raises(DataDamaged):
        checked_recording(topics_in_one_table(force_late_s=10.0))
    # Times that go back are refused as those of any other table.
    back = topics_in_one_table()
    with pytest.raises(DataDamaged):
        checked_recording(evolve(back, t_s=np.where(back.t_s > 0.5, back.t_s - 0.3, back.t_s)))
