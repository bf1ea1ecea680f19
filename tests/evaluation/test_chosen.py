"""The best of several candidates: who is called worse, and the rate of the chosen one, where the truth is known."""

import numpy as np
import pytest
import scipy
from cases import every_case

from graspsense.evaluation.chosen import comparisons_of, rate_of_chosen
from graspsense.evaluation.intervals import difference


def independent(rng, candidates):
    """Sixty trials, of which every candidate recognises 60 % on average."""
    return rng.random((candidates, 60)) < 0.6, np.full(candidates, 0.6), None


def alike(rng, candidates):
    """Trials that are hard are hard for every candidate."""
    hard, own = rng.normal(size=120), rng.normal(size=(candidates, 120))
    return 0.7 * hard + np.sqrt(0.51) * own < 0.5, np.full(candidates, scipy.special.ndtr(0.5)), None


def of_instances(rng, candidates):
    """Fifteen instances of eight trials, some hard for all candidates and some for a single one."""
    hard, own = rng.normal(size=15), rng.normal(size=(candidates, 15))
    each = 0.5 * np.repeat(hard, 8) + 0.4 * np.repeat(own, 8, axis=1)
    right = each + np.sqrt(0.59) * rng.normal(size=(candidates, 120)) < 0.6
    return right, np.full(candidates, scipy.special.ndtr(0.6)), [f"#{i}" for i in np.repeat(np.arange(15), 8)]


def unequal(rng, candidates):
    """Candidates whose rates differ by some points."""
    rates = np.clip(0.7 + 0.06 * rng.normal(size=candidates), 0.05, 0.97)
    return rng.random((candidates, 150)) < rates[:, np.newaxis], rates, None


SLOW = [pytest.param(*shape, marks=pytest.mark.slow) for shape in ((4, 40), (12, 40))]
LONG = [pytest.param(*shape, marks=pytest.mark.long) for shape in ((4, 100), (12, 60), (32, 40))]


@pytest.mark.parametrize(("candidates", "repeats"), [(4, 3), *SLOW, *LONG])
@pytest.mark.parametrize("drawn", [independent, alike, of_instances, unequal])
def test_no_equal_is_called_worse_and_the_rate_of_the_best_is_covered(drawn, candidates, repeats):
    worse, covered, excess = 0, 0, []
    for seed in range(repeats):
        right, rates, instances = drawn(np.random.default_rng((candidates, seed)), candidates)
        best = int(right.sum(axis=1).argmax())
        comparisons = comparisons_of(right, instances)
        losses = [
            difference(right[best].tolist(), right[i].tolist(), instances, comparisons).interval[0]
            for i in range(candidates)
            if rates[i] >= rates[best] and i != best
        ]
        worse += any(low > 0.0 for low in losses)
        chosen = rate_of_chosen(right, instances)
        covered += chosen.interval[0] <= rates[best] <= chosen.interval[1]
        excess.append(chosen.rate - rates[best])

    most = scipy.stats.binom.ppf(0.999, repeats, 0.05)
    assert worse <= most
    assert covered >= repeats - most
    assert abs(np.mean(excess)) < 3.3 * 0.07 / np.sqrt(
        repeats
    )  # a rate of 60 trials has a standard error of 7 points


def test_a_candidate_that_is_far_worse_is_told_and_the_rate_of_a_clear_best_stays():
    rng = np.random.default_rng(0)
    right = np.array([rng.random(300) < p for p in (0.95, 0.6, 0.6, 0.6)])
    comparisons = comparisons_of(right, None)

    assert all(
        difference(right[0].tolist(), candidate.tolist(), None, comparisons).interval[0] > 0
        for candidate in right[1:]
    )
    chosen = rate_of_chosen(right, None)
    assert chosen.rate == pytest.approx(right[0].mean(), abs=0.01)
    assert chosen.candidates == 4
    assert "(95 %: " in chosen.words


def test_a_rate_without_an_interval_has_no_level_of_confidence():
    right = np.random.default_rng(2).random((3, 40)) < 0.7

    chosen = rate_of_chosen(right, None, no_interval="class and object are the same")

    assert chosen.interval is None
    assert "95 %" not in chosen.words


def test_candidates_with_the_same_answers_are_one_comparison():
    right = np.random.default_rng(1).random(80) < 0.7

    assert comparisons_of(np.array([right] * 8), None) == 1.0
    # The quantile of 2000 draws is not exactly 1.96.
    assert comparisons_of(np.array([right, right, ~right]), None) == pytest.approx(1.0, abs=0.5)


@every_case(
    ("wins", "losses", "told"),
    [(7, 0, False), (13, 3, False), (11, 2, False), (9, 0, True), (11, 1, True), (60, 20, True)],
)
def test_of_four_candidates_on_few_trials_one_is_worse_only_if_the_sign_test_says_so(wins, losses, told):
    """4.4 comparisons: seven wins of seven have a probability of 2 / 2**7 = 0.016, which is not below 0.05 / 4.4."""
    both = [True] * 7
    best = both + [True] * wins + [False] * losses
    other = both + [False] * wins + [True] * losses
    low, high = difference(best, other, comparisons=4.4).interval
    assert (low > 0.0) is told
    turned = difference(other, best, comparisons=4.4).interval
    assert turned == pytest.approx((-high, -low))
