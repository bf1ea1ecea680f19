"""The answer of an experiment and the headline above it say the same, and of how many grasps."""

from types import SimpleNamespace

import numpy as np
import pytest
from cases import every_case

from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.features import FeatureTable
from graspsense.experiments.answer import answer, headline
from graspsense.experiments.summary import ConditionResult
from graspsense.experiments.task_results import ClassifierResult


def condition(name, *rates, n=100, simulated=True, target="both", cost=None):
    """Return a case with these rates of its seeds."""

    def rated(rate):
        predicted = ["can:full"] * round(rate * n) + ["can:empty"] * (n - round(rate * n))
        return ClassifierResult.from_answers(
            "c45", target, "stratified_10_fold", ["can:full"] * n, predicted, cost=cost
        )

    return ConditionResult(
        case=SimpleNamespace(name=name, part="", learners=(), levels={"force": name}),
        classifier="c45",
        target=target,
        by_seed={seed: rated(rate) for seed, rate in enumerate(rates)},
        simulated=simulated,
    )


def summary_of(*conditions):
    return SimpleNamespace(conditions=conditions, of_first_target=conditions, alike=())


@every_case(
    ("weak", "strong", "told", "above"),
    [
        ((0.50, 0.52, 0.51), (0.90, 0.91, 0.92), "20 N is better than 17 N", "highest rate"),
        ((0.90, 0.91, 0.90), (0.905, 0.91, 0.91), "agree within 2 points", "No case is shown"),
        ((0.50, 0.90, 0.70), (0.95, 0.60, 0.80), "cannot be told", "No case is shown"),
        ((0.80,), (0.82,), "cannot be told", "No case is shown"),
    ],
)
def test_an_answer_is_one_of_three_and_its_headline_agrees(weak, strong, told, above):
    summary = summary_of(condition("17 N", *weak, n=200), condition("20 N", *strong, n=200))

    assert told in answer(summary)
    assert above in headline(summary)
    for text in (answer(summary), headline(summary)):
        assert "200 simulated grasps" in text
        assert "best" not in text


@every_case("rates", [(0.5,), (0.5, 0.6)])
def test_an_answer_of_a_single_case_has_its_rate(rates):
    summary = summary_of(condition("17 N", *rates))
    for text in (answer(summary), headline(summary)):
        assert f"{100 * sum(rates) / len(rates):.0f}" in text


def test_equal_rates_of_few_grasps_are_not_said_to_agree():
    def told(*rates, n):
        return answer(summary_of(condition("17 N", *rates, n=n), condition("20 N", *rates, n=n)))

    assert "cannot be told" in told(0.5, n=4)
    assert "cannot be told" in told(0.5, 1.0, n=4)
    assert "cannot be told" not in told(0.5, 0.6, 0.7, n=2000)


@pytest.mark.parametrize(("simulated", "seeds"), [(False, 1), pytest.param(True, 30, marks=pytest.mark.slow)])
def test_among_many_cases_that_are_guesses_the_best_is_hardly_ever_said_to_be_better(simulated, seeds):
    """Of 20 cases that guess, the best and the worst differ by chance; a claim may be wrong once in 20 times."""
    rng = np.random.default_rng(0)
    claims = 0
    for _ in range(40):
        rates = rng.binomial(60, 0.5, size=(20, seeds)) / 60
        cases = [condition(f"{k} N", *rate, n=60, simulated=simulated) for k, rate in enumerate(rates)]
        claims += "is better than" in answer(summary_of(*cases))
    assert claims <= 3


@every_case("rates", [(0.8, 1.0), (1.0, 0.8), (0.5,), (1.0, 1.0, 0.0)])
def test_the_interval_of_recorded_trials_in_several_folds_is_around_their_mean(rates):
    rate = condition("17 N", *rates, n=20, simulated=False).rate
    low, high = rate.interval
    assert low <= rate.mean <= high
    assert high - low > 0.1


def test_the_interval_of_a_single_run_counts_the_objects_of_its_trials():
    """Five objects are always recognised and one never: that is what six objects tell, and not sixty trials."""
    objects = [k % 6 for k in range(60)]
    trials = Labelled(
        source="made here",
        table=FeatureTable(names=("x",), units=("",), values=np.zeros((60, 1))),
        labels=("can",) * 60,
        instances=tuple(f"can#{k}" for k in objects),
    )
    predicted = ["jar" if k == 0 else "can" for k in objects]
    low, high = ClassifierResult.from_answers(
        "c45", "both", "p", trials.labels, predicted, trials
    ).rate.interval
    assert high - low > 0.5
