"""Distances of distributions and their tests: what is equal passes, and what is shifted is told."""

import numpy as np
import pytest

from graspsense.evaluation.distribution import distribution_distance
from graspsense.evaluation.over_seeds import equivalence

RNG = np.random.default_rng(4)
LABELS = ["full"] * 200 + ["empty"] * 200
REFERENCE = np.concatenate([RNG.normal(1.0, 0.1, 200), RNG.normal(5.0, 2.0, 200)])


def distance_of(sample, limit=0.1):
    return distribution_distance("p", sample, REFERENCE, LABELS, limit)


def test_the_same_sample_has_no_distance_and_is_equivalent():
    same = distance_of(REFERENCE)
    assert (same.distance, same.upper, same.p_difference, same.power) == (0.0, 0.0, 1.0, 1.0)
    assert same.is_equivalent


def test_a_shift_has_its_size_in_standard_deviations_of_each_label():
    spread = np.concatenate(
        [np.full(200, REFERENCE[:200].std(ddof=1)), np.full(200, REFERENCE[200:].std(ddof=1))]
    )
    shifted = distance_of(REFERENCE + 0.3 * spread)
    assert shifted.distance == pytest.approx(0.3)
    assert shifted.p_difference < 0.01
    assert not shifted.is_equivalent
    assert distance_of(REFERENCE + 0.03 * spread).is_equivalent


def test_jumps_of_single_grasps_both_ways_are_no_difference_of_distributions():
    # Every fifth grasp jumps by 0.2 standard deviations: single grasps are off, the distribution is not.
    jumps = np.where(RNG.random(400) < 0.2, RNG.choice([-0.2, 0.2], 400), 0.0)
    moved = distance_of(REFERENCE + jumps * np.repeat([0.1, 2.0], 200))
    assert moved.distance < 0.03
    assert moved.p_difference > 0.01
    assert moved.is_equivalent


def test_values_that_are_missing_in_one_sample_only_count():
    holes = REFERENCE.copy()
    holes[::10] = np.nan
    assert distance_of(holes).distance == pytest.approx(0.1, abs=0.03)
    both = distribution_distance("p", holes, holes, LABELS, 0.1)
    assert both.distance == 0.0


def test_too_few_grasps_cannot_show_equivalence_and_the_power_says_so():
    rows = np.r_[0:6, 200:206]
    few = distribution_distance(
        "p", REFERENCE[rows], RNG.permutation(REFERENCE[:200])[:12], [LABELS[i] for i in rows], 0.01
    )
    assert not few.is_equivalent
    assert few.power < 0.1


def test_rates_are_equivalent_only_where_the_seeds_show_it():
    reference = 0.8 + 0.03 * RNG.standard_normal(100)
    near = reference + 0.004 + 0.01 * RNG.standard_normal(100)
    assert equivalence(near, reference, 100).is_equivalent
    assert equivalence(near, reference, 100).power > 0.99
    assert not equivalence(reference - 0.03, reference, 100).is_equivalent
    # Three seeds that differ by 5 points each way show nothing, although their mean difference is 0.
    few = equivalence([0.75, 0.80, 0.85], [0.8, 0.8, 0.8], 100)
    assert few.difference == pytest.approx(0.0)
    assert not few.is_equivalent
    assert few.power == 0.0


def test_pairs_are_needed():
    with pytest.raises(ValueError, match="pairs"):
        distribution_distance("p", [1.0], [1.0, 2.0], ["a"], 0.1)
    with pytest.raises(ValueError, match="two or more"):
        equivalence([0.5], [0.5], 10)
