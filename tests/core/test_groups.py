"""Trials that belong together without an instance that says so are held out together, and the certainty shows it."""

from collections import Counter

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from test_conformal import model_of
from test_evaluate import labelled, learner

from graspsense.core.components.registry import installed
from graspsense.core.learn.clumps import mean_ranks
from graspsense.core.learn.copies import without_copies
from graspsense.core.learn.groups import grouped
from graspsense.core.learn.model_file import load_model, write_model
from graspsense.evaluation.evaluate import evaluate
from graspsense.report.verdict import verdict

NO_COPIES = np.empty((2, 0), dtype=np.int64)
MEANS = 1.3 * np.random.default_rng(5).normal(size=(3, 4))


def things(numbers, rng, spread=1.0):
    """Features of grasps of three kinds of things, each grasp by itself."""
    return MEANS[numbers] + spread * rng.normal(size=(len(numbers), 4))


def table_of(numbers, values, **columns):
    return labelled([f"thing {k}" for k in numbers], *values.T, **columns)


def by_object(rng, objects=6, each=5):
    """Grasps of several objects of each kind one after the other, which differ more than grasps of one of them."""
    numbers = np.repeat(np.arange(3), objects * each)
    own = np.repeat(1.2 * rng.normal(size=(3 * objects, 4)), each, axis=0)
    return numbers, things(numbers, rng, 0.5) + own


def windows(rng, recordings=6, each=10):
    """Windows that overlap by nine tenths, of several recordings of each kind."""
    numbers = np.repeat(np.arange(3), recordings * each)
    values = things(np.repeat(np.arange(3), recordings), rng, 0.7).repeat(each, axis=0)
    last = np.zeros(4)
    for row in range(len(values)):
        last = rng.normal(size=4) if row % each == 0 else 0.9 * last + 0.44 * rng.normal(size=4)
        values[row] += 0.7 * last
    return numbers, values


def uneven(rng):
    """One to nine grasps of each of nine objects of each kind."""
    numbers, values = by_object(rng, objects=9, each=9)
    kept = np.arange(len(numbers)) % 9 < np.repeat(rng.integers(1, 10, 27), 9)
    return table_of(numbers[kept], values[kept])


def pasted(rng, kinds=3, each=15):
    """Each grasp twice, the second time with other digits, in any order."""
    numbers = np.repeat(np.arange(kinds), each)
    values = things(numbers, rng)
    order = rng.permutation(2 * len(numbers))
    copies = np.concatenate([values, values + 0.01 * rng.normal(size=values.shape)])
    return np.tile(numbers, 2)[order], copies[order], order % len(numbers)


def test_copies_with_other_digits_are_in_one_group_and_other_trials_are_not():
    numbers, values, original = pasted(np.random.default_rng(0))
    trials = without_copies(table_of(numbers, values))
    pairs = set(zip(trials.instances, original.tolist(), strict=True))
    assert trials.grouped
    assert len(set(trials.instances)) > 40, "45 grasps were pasted; a few lie close together by chance"
    assert len(pairs) == 45, "both copies of a grasp are in one group"


def test_ranks_are_those_of_scipy():
    from scipy.stats import rankdata

    values = np.random.default_rng(0).integers(0, 9, (40, 5)).astype(float)
    values[3, 1:3] = np.nan
    np.testing.assert_array_equal(mean_ranks(values), rankdata(values, axis=0, nan_policy="omit"))


def test_near_copies_join_the_named_instances_that_they_are_of():
    numbers, values, original = pasted(np.random.default_rng(0))
    names = [f"bottle {k}" for k in range(len(numbers))]
    trials = without_copies(table_of(numbers, values, instances=tuple(names)))
    assert not trials.grouped
    assert set(trials.instances) < set(names)
    assert len(set(trials.instances)) == len(set(zip(trials.instances, original, strict=True)))


def test_near_copies_of_one_named_instance_are_told_of_by_its_name():
    numbers, values, original = pasted(np.random.default_rng(0))
    named = table_of(numbers, values, instances=tuple(f"bottle {k}" for k in original))
    assert without_copies(named) is named


@every_case("make", [by_object, windows])
def test_neighbours_that_are_alike_are_held_out_in_blocks_of_the_order_of_recording(make):
    rng = np.random.default_rng(1)
    numbers, values = make(rng)
    trials = grouped(table_of(numbers, values), NO_COPIES)
    assert trials.grouped
    assert 6 <= len(set(trials.instances)) < len(numbers) / 3
    assert all(
        len({trials.labels[i] for i in np.flatnonzero(np.array(trials.instances) == name)}) == 1
        for name in set(trials.instances)
    )
    order = rng.permutation(len(numbers))
    mixed = table_of(numbers[order], values[order])
    in_time = grouped(evolve(mixed, order=tuple(order.tolist())), NO_COPIES)
    assert [in_time.instances[i] == in_time.instances[k] for i, k in np.ndindex(30, 30)] == [
        trials.instances[order[i]] == trials.instances[order[k]] for i, k in np.ndindex(30, 30)
    ]


@pytest.mark.slow
@every_case("stretches", [2, 4])
def test_stretches_of_a_label_that_are_alike_as_after_a_new_mounting_are_held_out_whole(stretches):
    numbers = np.tile(np.repeat(np.arange(2), 8), stretches)
    stretch_of = np.arange(len(numbers)) // 8
    told = {"mounted anew": 0, "as before": 0}
    for seed in range(10):
        rng = np.random.default_rng(seed)
        values = things(numbers, rng)
        mounted = values + 1.5 * rng.normal(size=(2 * stretches, 4))[stretch_of]
        order = tuple(range(len(numbers)))
        trials = grouped(table_of(numbers, mounted, order=order), NO_COPIES)
        told["mounted anew"] += trials.grouped and all(
            len({trials.instances[i] for i in np.flatnonzero(stretch_of == k)}) == 1
            for k in range(2 * stretches)
        )
        told["as before"] += grouped(table_of(numbers, values, order=order), NO_COPIES).grouped
    assert told["mounted anew"] >= 9
    assert told["as before"] == 0


@pytest.mark.slow
def test_windows_and_grasps_of_unnamed_objects_in_any_order_are_held_out_together_and_other_trials_are_not():
    told = Counter()
    for seed in range(10):
        rng = np.random.default_rng(seed)
        numbers, values = windows(rng, recordings=12, each=20)
        alone = np.repeat(np.arange(3), 80)
        single = things(alone, rng)
        distance = np.hypot(*single[:, :2].T)
        made = {
            "windows": table_of(numbers, values),
            "objects": table_of(*by_object(rng, objects=9, each=9)),
            "objects with uneven trials": uneven(rng),
            "single": table_of(alone, single),
            "inside and outside": table_of((distance > np.median(distance)).astype(int), single),
        }
        for name in ("objects", "single"):
            values = made[name].table.values.copy()
            values[rng.random(values.shape) < 0.05] = np.nan
            values[rng.random(len(values)) < 0.1] = np.nan
            table = evolve(made[name].table, values=values)
            made[f"{name}, with missing values"] = evolve(made[name], table=table)
        for name, trials in made.items():
            mixed = trials.rows(rng.permutation(len(trials)))
            told[name] += bool(grouped(mixed, NO_COPIES).no_certainty)
    assert told["windows"] >= 9
    assert min(told["objects"], told["objects, with missing values"]) >= 4
    assert told["objects with uneven trials"] >= 7
    assert told["single"] == told["inside and outside"] == 0
    # Independent trials are seldom in clumps by chance; those of the first seed are.
    assert told["single, with missing values"] <= 1


@pytest.mark.slow
def test_noisy_copies_of_every_trial_in_any_order_are_in_groups_of_about_as_many():
    groups, whole = [], []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        original = rng.permutation(np.repeat(np.arange(60), 3))
        numbers = original % 3
        values = rng.normal(size=(60, 4))[original] + numbers[:, np.newaxis]
        noisy = values + 0.15 * rng.normal(size=values.shape)
        trials = grouped(table_of(numbers, noisy), NO_COPIES)
        groups.append(len(set(trials.instances or ())))
        in_groups = {*zip(trials.instances or (), original.tolist(), strict=True)} if groups[-1] else ()
        whole.append(len(in_groups))
        # On a lattice, distances repeat: that is no sign of copies.
        single = rng.normal(size=(150, 3))
        for coarse in (single, single.round(1), single.round()):
            alone = table_of(np.arange(150) % 2, coarse)
            assert grouped(alone, NO_COPIES) is alone
        # Labels of a few trials each that are far from each other are no objects.
        for each in (4, 6, 10):
            kinds = np.repeat(np.arange(12), each)
            apart = table_of(kinds, 6.0 * rng.normal(size=(12, 4))[kinds] + rng.normal(size=(len(kinds), 4)))
            assert grouped(apart, NO_COPIES) is apart
    assert min(groups) > 30
    assert max(groups) <= 60
    assert max(whole) < 1.5 * 60, "most copies of a trial are in one group"


def test_neighbours_are_alike_or_not_also_where_rounded_features_are_equal_by_chance():
    rng = np.random.default_rng(1)
    numbers, values = by_object(rng)
    assert without_copies(table_of(numbers, values.round())).grouped
    order = rng.permutation(len(numbers))
    mixed = without_copies(table_of(numbers[order], values[order].round()))
    assert (len(mixed), mixed.instances) == (len(numbers), None)


def test_named_instances_and_trials_sorted_by_a_feature_have_no_blocks():
    numbers, values = by_object(np.random.default_rng(1))
    named = table_of(numbers, values, instances=tuple(f"trial {k}" for k in range(len(numbers))))
    assert grouped(named, NO_COPIES) is named
    single = things(numbers, np.random.default_rng(1))
    by_force = np.lexsort((single[:, 0], numbers))
    table = table_of(numbers[by_force], single[by_force])
    assert grouped(table, NO_COPIES) is table


@pytest.mark.slow
@every_case("each", [5, 20, 60])
def test_grasps_that_do_not_resemble_their_neighbours_are_no_groups(each):
    for seed in range(40):
        rng = np.random.default_rng(seed)
        numbers = np.repeat(np.arange(3), each)
        values = things(numbers, rng).round(1)
        values[rng.random(values.shape) < 0.1] = np.nan
        trials = table_of(numbers, values)
        assert grouped(trials, NO_COPIES) is trials, f"seed {seed}"


@pytest.mark.slow
@every_case("make", [by_object, windows, pasted])
def test_what_is_said_of_new_objects_is_not_too_sure(make):
    too_sure = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        numbers, values, *_ = make(rng)
        model = model_of(without_copies(table_of(numbers, values)), "tree")
        new = np.repeat(np.arange(3), 60)
        for prediction, k in zip(
            model.predictions(table_of(new, things(new, rng, 1.1)).table), new, strict=True
        ):
            right = prediction.label == f"thing {k}"
            too_sure.append(0.0 if prediction.certainty is None else prediction.certainty - right)
    # With single trials held out, it would be 9, 17 and 12 points.
    assert np.mean(too_sure) < 0.03


@pytest.mark.slow
def test_a_certainty_says_for_which_objects_and_sessions_it_holds_unless_others_were_held_out(tmp_path):
    numbers, values = by_object(np.random.default_rng(1), objects=20)
    trials = table_of(numbers, values)
    named = evolve(trials, instances=tuple(f"bottle {k // 5}" for k in range(len(numbers))))
    order = np.random.default_rng(2).permutation(len(numbers))
    for known, held_for in (
        (named, "the same sessions"),
        (evolve(named, sessions=True), "the same objects"),
        (evolve(named, provenance={"simulated": True}), ""),
        (grouped(trials, NO_COPIES), "the same objects and sessions"),
        (trials.rows(order), "the same objects and sessions"),
    ):
        write_model(tmp_path / "m.json", model_of(known, "tree"))
        made = load_model(str(tmp_path / "m.json"), installed()).predictions(known.table)
        (certain, *_) = [prediction for prediction in made if prediction.certainty is not None]
        assert certain.holds_for == certain.as_json()["holds_for"] == held_for
        for words in filter(None, (certain.certainty_in_words, certain.set_in_words)):
            assert (f" for {held_for}" in words) if held_for else (" for " not in words)
        assert any("drifted" in warning for warning in certain.warnings) == held_for.endswith("sessions")


def test_a_rate_with_groups_held_out_is_not_said_to_be_that_of_new_objects():
    numbers, values, _ = pasted(np.random.default_rng(0))
    evaluation = evaluate(learner("c45"), without_copies(table_of(numbers, values)), permutations=1)
    assert evaluation.protocol == "group_held_out"
    assert evaluation.sets.unit == "groups"
    assert evaluation.headline.correct < evaluation.protocols["stratified_10_fold"].rate.correct
    assert "other grasps" in verdict(evaluation)


@pytest.mark.slow
def test_instances_that_are_named_by_days_of_several_classes_are_held_out_as_days():
    rng = np.random.default_rng(2)
    numbers = np.tile(np.repeat(np.arange(3), 4), 5)
    days = np.repeat(["monday", "tuesday", "friday", "monday-2", "sunday"], 12)
    values = things(numbers, rng)

    def instances_of(names, **columns):
        named = tuple(f"thing {k}#{name}" for k, name in zip(numbers, names, strict=True))
        return without_copies(table_of(numbers, values, instances=named, **columns))

    in_order = tuple(range(len(numbers)))
    assert set(instances_of(days, order=in_order).instances) == set(days)
    result = evaluate(learner(), instances_of(days, order=in_order))
    assert result.headline.no_interval
    assert set(instances_of(["today"] * len(numbers), order=in_order).instances) == {"today"}
    # Numbers count the objects of a class; colours that were grasped in turns are no session; without a time, nothing
    # tells which of them it is.
    counted, colours = np.unique(days, return_inverse=True)[1], np.tile(["red", "green"], len(numbers) // 2)
    assert len(set(instances_of(counted, order=in_order).instances)) == 15
    assert len(set(instances_of(colours, order=in_order).instances)) == 6
    unordered = instances_of(days)
    assert len(set(unordered.instances)) == 15
    assert unordered.notes
