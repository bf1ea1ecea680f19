import interval_coverage
import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.evaluation.intervals import RecognitionRate, difference, rate_of, wilson
from graspsense.evaluation.json_codec import from_json, to_json


@every_case(
    ("correct", "n", "low", "high"),
    [
        # Rates of Chitta, Piccoli and Sturm (ICRA 2010) with their 95 % Wilson intervals, worked out apart from us.
        (215, 229, 0.900, 0.963),
        (67, 96, 0.600, 0.781),
        (80, 96, 0.746, 0.895),
        (91, 96, 0.884, 0.978),
        (24, 41, 0.434, 0.722),
        (31, 42, 0.589, 0.847),
        (26, 80, 0.232, 0.434),
        (95, 149, 0.558, 0.710),
        (207, 275, 0.698, 0.800),
    ],
)
def test_wilson_on_published_rates(correct, n, low, high):
    assert wilson(correct, n) == (pytest.approx(low, abs=5e-4), pytest.approx(high, abs=5e-4))


@given(st.integers(1, 500), st.data())
def test_wilson_lies_in_the_unit_and_holds_the_rate(n, data):
    correct = data.draw(st.integers(0, n))
    low, high = wilson(correct, n)

    assert 0.0 <= low <= correct / n <= high <= 1.0
    assert low < high
    assert wilson(n - correct, n) == (pytest.approx(1 - high), pytest.approx(1 - low))


@pytest.mark.parametrize(("correct", "n"), [(1, 0), (-1, 3), (4, 3)])
def test_what_is_no_rate_is_refused(correct, n):
    with pytest.raises(ValueError, match=f"^{correct} .* {n} "):
        RecognitionRate(correct, n)


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1, max_size=60))
def test_a_difference_turns_its_sign_with_its_sides(pairs):
    left, right = [a for a, _ in pairs], [b for _, b in pairs]
    forward, other = difference(left, right), difference(right, left)

    assert forward.value == pytest.approx((sum(left) - sum(right)) / len(pairs))
    assert forward.interval[0] <= forward.value <= forward.interval[1]
    assert other.value == pytest.approx(-forward.value)
    assert other.interval == (pytest.approx(-forward.interval[1]), pytest.approx(-forward.interval[0]))


def test_equal_judgements_differ_by_nothing():
    gain = difference([True, False] * 20, [True, False] * 20)

    assert gain.value == 0.0
    assert gain.interval[0] < 0.0 < gain.interval[1]


def test_the_interval_of_a_difference_covers_the_true_one_nineteen_times_in_twenty():
    rng = np.random.default_rng(0)
    both, only_first, only_second = 0.55, 0.20, 0.08
    covered, runs = 0, 1000
    for _ in range(runs):
        u = rng.random(100)
        left = u < both + only_first
        right = (u < both) | ((u >= both + only_first) & (u < both + only_first + only_second))
        low, high = difference(left.tolist(), right.tolist()).interval
        covered += low <= only_first - only_second <= high

    assert 0.93 < covered / runs < 0.98


def test_of_two_lengths_there_is_no_difference():
    with pytest.raises(ValueError, match="1 and 2 trials"):
        difference([True], [True, False])


def counted(counts, trials=8):
    """Return which trials are right, and the instance of each, from the right trials of every instance."""
    right = [j < count for count in counts for j in range(trials)]
    return right, [f"bottle#{i}" for i in range(len(counts)) for _ in range(trials)]


@every_case("instances", [6, 12])
@every_case("correlation", [0.1, 0.3])
def test_the_interval_over_instances_covers_where_that_of_the_trials_does_not(instances, correlation):
    """benchmarks/interval_coverage.py prints the whole table."""
    rng = np.random.default_rng(0)
    rate, size, runs = 0.85, (1 - correlation) / correlation, 400
    covered = by_trials = 0
    for _ in range(runs):
        right, names = counted(rng.binomial(8, rng.beta(rate * size, (1 - rate) * size, instances)))
        low, high = rate_of(right, names).interval
        covered += low <= rate <= high
        low, high = RecognitionRate(sum(right), len(right)).interval
        by_trials += low <= rate <= high

    assert covered / runs > 0.92
    assert by_trials / runs < 0.91


def test_the_difference_over_instances_covers_too():
    """Half of 12 instances are recognised better by the first, half by the second: the true difference is 0."""
    rng = np.random.default_rng(0)
    runs, covered, by_trials = 400, 0, 0
    for _ in range(runs):
        shift = rng.choice([-0.25, 0.25], 12)
        left, names = counted(rng.binomial(8, 0.6 + shift))
        right, _ = counted(rng.binomial(8, 0.6 - shift))
        low, high = difference(left, right, names).interval
        covered += low <= 0.0 <= high
        low, high = difference(left, right).interval
        by_trials += low <= 0.0 <= high

    assert covered / runs > 0.92
    assert by_trials / runs < 0.8


def test_fewer_than_six_instances_have_no_interval_but_the_reason():
    right, names = counted([8, 7, 8, 2, 8])

    rate = rate_of(right, names)
    assert rate.interval is None
    assert "no interval: 5 instances, at least 6 are needed" in rate.words
    assert difference(right, right, names).interval is None
    assert not difference(right, [False] * len(right), names).is_positive
    assert from_json(to_json(rate), RecognitionRate) == rate


@pytest.mark.parametrize("counts", [[8] * 6, [0] * 6, [8, 8, 8, 8, 8, 7]])
def test_instances_that_agree_give_no_interval_narrower_than_their_trials(counts):
    right, names = counted(counts)

    low, high = rate_of(right, names).interval
    below, above = RecognitionRate(sum(right), len(right)).interval
    assert 0.0 <= low <= below <= above <= high <= 1.0


@pytest.mark.slow
def test_the_interval_of_a_cross_validated_rate_covers_the_rate_of_such_trials():
    measured = interval_coverage.evaluated(12, 60)
    assert measured["graspsense"] >= 0.9
    assert measured["of difference"] >= 0.9


def test_folds_that_share_their_training_trials_widen_an_interval():
    # The variance of a mean of ten folds is multiplied by 1 + 10 / 9.
    effect = 1.0 + 10.0 / 9.0
    right = [True] * 30 + [False] * 10
    assert rate_of(right, folds=10).interval == pytest.approx(wilson(30 / effect, 40 / effect))


def test_folds_widen_the_interval_of_a_difference_over_instances_by_the_root_of_their_effect():
    left, names = counted([8, 6, 7, 5, 8, 3, 7, 6])
    right, _ = counted([5, 6, 3, 5, 4, 3, 5, 2])
    alone, folded = difference(left, right, names), difference(left, right, names, folds=10)
    assert folded.value == alone.value
    assert folded.interval[1] - folded.value >= 1.4 * (alone.interval[1] - alone.value)


def test_what_few_answers_of_a_cross_validation_show_is_not_shown():
    # Eight trials differ, all in favour of the first: 2 / 2**8 is below 0.05 / 3. Ten folds let them count as 3.8.
    left, right = [True] * 40, [True] * 32 + [False] * 8
    assert difference(left, right, comparisons=3.0).is_positive
    assert not difference(left, right, comparisons=3.0, folds=10).is_positive
