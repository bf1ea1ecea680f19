from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.values.errors import ConfigError
from graspsense.evaluation.folds import commonest, in_order, instance_held_out, stratified

LABELS = st.lists(st.sampled_from("abcd"), min_size=10, max_size=80)


@given(LABELS, st.integers(2, 10), st.integers(0, 5))
def test_stratified_folds_are_equal_in_size_and_in_every_label(labels, k, seed):
    folds = stratified(labels, k, seed)

    sizes = np.bincount(folds, minlength=k)
    assert sizes.max() - sizes.min() <= 1
    for label in set(labels):
        counts = np.bincount(folds[np.array(labels) == label], minlength=k)
        assert counts.max() - counts.min() <= 1
    assert folds.tolist() == stratified(labels, k, seed).tolist()


def test_another_seed_deals_otherwise():
    labels = ["a", "b"] * 30

    assert stratified(labels, 10, 0).tolist() != stratified(labels, 10, 1).tolist()


@given(
    st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 6)), min_size=10, max_size=80),
    st.integers(0, 3),
)
def test_an_instance_lies_in_one_fold_whatever_its_labels(trials, seed):
    labels, things = [label for label, _ in trials], [f"thing {i}" for _, i in trials]
    if len(set(things)) < 2:
        return
    folds = instance_held_out(labels, things, 10, seed)

    for thing in set(things):
        assert len({fold for fold, other in zip(folds, things, strict=True) if other == thing}) == 1
    assert set(folds.tolist()) == set(range(min(10, len(set(things)))))


def test_instances_of_each_class_are_spread_over_the_folds():
    labels = [label for label in ("bottle", "can") for _ in range(10) for _ in range(3)]
    things = [f"{label}{i}" for label in ("bottle", "can") for i in range(10) for _ in range(3)]
    folds = instance_held_out(labels, things, 5, 0)

    assert all(Counter(zip(folds.tolist(), labels, strict=True))[fold, "can"] == 6 for fold in range(5))


def test_blocks_follow_the_order_of_recording_within_each_label():
    labels = ["a"] * 10 + ["b"] * 5
    order = [*range(10, 0, -1), 100, 300, 200, 500, 400]

    folds = in_order(labels, order, 5)

    assert folds[:10].tolist() == [4, 4, 3, 3, 2, 2, 1, 1, 0, 0]
    assert folds[10:].tolist() == [0, 2, 1, 4, 3]


@pytest.mark.parametrize(("n", "k"), [(5, 10), (5, 1), (5, 0)])
def test_too_few_trials_or_folds(n, k):
    with pytest.raises(ConfigError, match="fold"):
        stratified(["a"] * n, k, 0)


def test_of_equals_the_first_by_name_is_the_commonest():
    assert commonest(["b", "a", "c", "a", "b"]) == "a"
