"""A copy is not another trial: what is stored, recovered, imported or pasted twice counts once."""

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense, printed
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense.core.learn.copies import apart_from, learned_from, row_hashes, without_copies
from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.signals import Frame, Reading, no_pads
from graspsense.recording.replayable import curve_bytes, grasp_numbers
from graspsense.sources.trial_source import load_trials
from graspsense.store.recover import recover_file


def labelled(values, labels=None, content=None):
    values = np.array(values, dtype=float)
    names = tuple(f"f{i}" for i in range(values.shape[1]))
    return Labelled(
        source="made here",
        table=FeatureTable(names=names, units=("",) * len(names), values=values),
        labels=tuple(labels or ["a", "b"] * (len(values) // 2) + ["a"] * (len(values) % 2)),
        content=content,
    )


def measured(trials=40, features=3, seed=0):
    return np.random.default_rng(seed).normal(size=(trials, features))


def copies_said(trials):
    return [note for note in trials.notes if "copies" in note]


@pytest.mark.slow
@settings(max_examples=25)
@given(
    seed=st.integers(0, 1000),
    times=st.integers(2, 6),
    features=st.integers(1, 4),
    digits=st.sampled_from([5, 17]),
)
def test_measured_trials_count_once_however_often_they_are_pasted(seed, times, features, digits):
    values = np.array([[float(f"{v:.{digits}g}") for v in row] for row in measured(30, features, seed)])
    rng = np.random.default_rng(seed)
    order = rng.permutation(np.tile(np.arange(30), times))
    kept = without_copies(labelled(values[order], [f"{i % 2}" for i in order]))
    assert sorted(map(tuple, kept.table.values)) == sorted(map(tuple, values))
    assert copies_said(kept)


def without(values, rows, columns=slice(None)):
    changed = np.array(values)
    changed[rows, columns] = np.nan
    return changed


DRAWN = np.random.default_rng(1)
WIDTHS = [[0.018499999999999999, np.nan]] * 4 + [[0.019000000000000003, np.nan]] * 4
FEW_VALUES = without(measured(60, 4), slice(20))
FEW_VALUES[:10, 0] = np.arange(10) % 3

GAPS_M, FALLS_M = DRAWN.integers(600, 640, 30) * 9e-5, DRAWN.integers(20, 60, 30) * 9e-5
STIFF = np.arange(30) % 2 == 0
QUANTISED = np.stack(
    [GAPS_M, GAPS_M - np.where(STIFF, 0.0, FALLS_M), np.where(STIFF, 0.0, FALLS_M * 150), FALLS_M / GAPS_M],
    axis=1,
)
"""Gaps in steps of an encoder: an object that does not yield has the first one twice, no duration and no speed."""


@every_case(
    ("values", "labels", "content", "kept", "said", "not_said"),
    [
        (without(measured(), slice(None, None, 4)), None, None, 40, None, "copies"),  # no feature is no copy
        (
            np.concatenate([measured(10), measured(10)[:1]]),
            [*"ababababab", "b"],
            None,
            10,
            "another label",
            None,
        ),
        # A feature that hardly varies, such as the gap at the contact of presses that begin alike, makes no copies
        # of recordings that were compared and differ.
        (WIDTHS, None, tuple("abcdefgh"), 8, None, None),
        (WIDTHS, None, tuple("aaaaefgh"), 5, None, None),
        # Where a feature set finds no contact, it gives no features, or one that has few values.
        (FEW_VALUES, None, None, 53, None, "of the features"),
        # Copies of coarse trials are found where chance cannot make them.
        (
            np.tile(np.random.default_rng(2).integers(0, 50, size=(30, 6)), (2, 1)),
            None,
            None,
            30,
            "copies",
            None,
        ),
        # Also where what chance makes equal is only that of some of the trials.
        (without(QUANTISED, STIFF, 3), None, None, 30, "by chance", "copies"),
        # Coarse features that are equal by chance: counts, marks on a scale, a width in whole millimetres, ticks of an
        # encoder, on and off.
        *(
            (values, None, None, len(values), "by chance", None)
            for values in (
                DRAWN.integers(0, 4, size=(60, 1)),
                DRAWN.integers(0, 3, size=(200, 4)),
                DRAWN.integers(40, 60, size=(60, 1)) * 0.001,
                DRAWN.integers(300, 360, size=(200, 1)) * 7.3e-5,
                DRAWN.integers(0, 2, size=(60, 1)) * [[1e-9, 0.0]],
            )
        ),
    ],
)
def test_what_is_a_copy_counts_once_and_is_said(values, labels, content, kept, said, not_said):
    trials = without_copies(labelled(values, labels, content))
    assert len(trials) == kept
    assert said is None or any(said in note for note in trials.notes)
    assert not any(not_said and not_said in note for note in trials.notes)


def test_of_a_grasp_with_a_damaged_copy_the_one_with_more_features_is_kept():
    values = without(measured(4), 1, slice(1, None))
    kept = without_copies(labelled(values, "abab", content=("", "x", "x", "")))
    assert kept.table.values.tolist() == np.delete(values, 1, axis=0).tolist()


def test_trials_that_were_learned_from_are_not_tested_on():
    training, others = labelled(measured(seed=0)), measured(seed=1)
    mixed = labelled(np.concatenate([others, training.table.values[:7]]))
    kept = apart_from(mixed, training)
    assert kept.table.values.tolist() == others.tolist()
    assert "7 trials" in copies_said(kept)[0]
    with pytest.raises(ConfigError, match="every trial"):
        apart_from(training, training)


def test_a_trial_of_which_one_coarse_feature_is_known_is_not_said_to_be_learned_from():
    values = measured(20)
    values[:5] = [[0.25, np.nan, np.nan]] * 5
    table = labelled(values).table
    known = row_hashes(table)
    others = measured(20, seed=1)
    others[:5] = values[:5]
    assert learned_from(known, labelled(others).table) == ""
    assert learned_from(known, table).startswith("15 of 20")
    alone = labelled(values[:, :1]).table
    assert learned_from(row_hashes(alone), alone).startswith("20 of 20")


def test_copies_are_found_among_columns_in_another_order_and_other_units_are_refused():
    training = labelled(measured())
    table = training.table
    turned = evolve(training, table=table.columns(table.names[::-1]))
    with pytest.raises(ConfigError, match="every trial"):
        apart_from(turned, training)
    in_m, in_mm = (
        evolve(labelled(measured(seed=seed)), table=evolve(table, units=(unit, "", "")))
        for seed, unit in enumerate(("m", "mm"))
    )
    with pytest.raises(ConfigError, match=r"f0 in m;.* mm$"):
        apart_from(in_mm, in_m)


def readings(force, ticks=40):
    # Without a force, nothing moves.
    frames = (
        Frame(k * 0.01, 0.01, 0.06 - 0.001 * force * k, 0.0, 5.0, force * k, force * k, 0.0, 0.0, 0)
        for k in range(ticks)
    )
    return [Reading(frame, no_pads(0), ()) for frame in frames]


def test_the_part_of_a_recording_is_of_the_same_grasp():
    still = readings(0.0)
    curves = [readings(0.1)[:25], readings(0.1), readings(0.2), readings(0.1), still, still[:20]]
    assert grasp_numbers([curve_bytes(curve) for curve in curves]) == [1, 1, 2, 1, 4, 5]


COARSE = ("-o", "classifier.type=none", "-o", "gripper.rate_hz=250", "-o", "gripper.sensor=ideal")
"""Settings with which a simulated grasp takes a fraction of the time."""


@pytest.mark.slow
def test_each_grasp_that_run_saves_is_another_one_unless_a_seed_is_given(tmp_path):
    store = tmp_path / "s"

    def run(*words):
        done = graspsense("run", "--save", store, *COARSE, "--label", "block", "--json", *words)
        assert done.returncode == 0
        return done.json["seed"], done.stderr

    (drawn, told), (other, _) = run(), run()
    assert drawn != other
    assert f"--seed {drawn}" in told
    assert run("-o", f"run.seed={drawn}")[0] == drawn
    trials = load_trials(f"store:{store}")
    assert len(trials) == 2
    assert "1 trial" in copies_said(trials)[0]


@pytest.mark.slow
def test_a_damaged_recording_and_its_recovered_copy_are_one_trial(tmp_path):
    folder = tmp_path / "s"
    for seed in (0, 1):
        printed("run", "--save", folder, "--label", "block", "--seed", seed, *COARSE)
    recording = sorted((folder / "recordings").glob("*.mcap"))[0]
    recording.write_bytes(recording.read_bytes()[:-200])
    copy = recover_file(recording, tmp_path / "copy.mcap").recording
    printed("import", copy, "--label", "block", "--save", folder)
    trials = load_trials(f"store:{folder}")
    assert len(trials) == 2
    assert copies_said(trials)


@every_case("column", [0, 1, 2])
@every_case("change", ["another value", "a missing value"])
def test_copies_with_one_value_changed_are_told(change, column):
    values = measured(seed=1).round(4)
    edited = values.copy()
    edited[:, column] = np.nan if change == "a missing value" else edited[:, column] + 0.5
    labels = ["a"] * 20 + ["b"] * 20
    kept = without_copies(labelled(np.concatenate([values, edited]), labels * 2))
    assert any("one, or more: 40 (trial 41, of trial 1)" in n for n in kept.notes)
    assert kept.instances[:40] == kept.instances[40:]
    assert without_copies(labelled(values, labels)).notes == ()


def test_a_single_copy_with_one_value_changed_hides_no_windows_of_a_recording():
    rng = np.random.default_rng(3)
    windows = rng.normal(size=(20, 5)).repeat(12, axis=0) + 0.3 * rng.normal(size=(240, 5))
    values = np.concatenate([windows, windows[5:6]]).round(4)
    values[240, 2] += 0.5
    kept = without_copies(labelled(values, [f"{k // 12 % 2}" for k in range(240)] + ["0"]))
    assert any("of one recording" in note for note in kept.notes)
    assert kept.instances[240] == kept.instances[5]


def test_features_that_follow_each_other_make_no_copies():
    width = np.random.default_rng(4).normal(60.0, 4.0, 60).round(2)
    values = np.column_stack([width, (width / 25.4).round(4), 0.001 * width, measured(60, 2)])
    assert without_copies(labelled(values)).notes == ()
    values = np.maximum(measured(300, 4), [-9.0, -9.0, -1.8, -1.8]).round(4)
    values[:12, 2:] = -1.8  # of a sensor and what is computed from it
    assert without_copies(labelled(values)).notes == ()


NEAR = {
    "rounded": lambda values, rng: values.round(3),
    "shifted digits": lambda values, rng: values + 1e-5 * rng.normal(size=values.shape),
    "scaled": lambda values, rng: 1.001 * values,
    "augmented with noise": lambda values, rng: values + 0.02 * rng.normal(size=values.shape),
}


@every_case("change", NEAR)
def test_copies_with_other_digits_are_said(change):
    values = measured(30)
    changed = NEAR[change](values, np.random.default_rng(1))
    kept = without_copies(labelled(np.concatenate([values, changed])))
    assert len(kept) == 60
    assert any("another trial" in note for note in kept.notes)


@pytest.mark.slow
@given(seed=st.integers(0, 10_000), features=st.integers(2, 5))
def test_measured_trials_are_not_taken_for_near_copies(seed, features):
    rng = np.random.default_rng(seed)
    objects = rng.normal(size=(12, features))
    grasps = np.repeat(objects, 5, axis=0) + 0.5 * rng.normal(size=(60, features))
    one_number = rng.normal(size=(60, 1)) + 0.02 * rng.normal(size=(60, features))
    for values in (
        rng.normal(size=(60, features)),
        grasps,
        one_number,
        rng.lognormal(0, 1.5, (60, features)),
    ):
        assert not any("closer to" in note for note in without_copies(labelled(values)).notes)


@every_case("each", [5, 10])
def test_grasps_of_one_named_object_may_be_close(each):
    grasps = np.repeat(measured(12), each, axis=0) + 0.01 * measured(12 * each, seed=1)
    unnamed = labelled(grasps, [f"{k // each % 2}" for k in range(12 * each)])
    named = evolve(unnamed, instances=tuple(f"bottle {k // each}" for k in range(12 * each)))
    assert any(f"{each - 1} other trials" in note for note in without_copies(unnamed).notes)
    assert not without_copies(named).notes
