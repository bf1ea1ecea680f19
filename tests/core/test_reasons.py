"""Reasons of predictions: contributions add up to the prediction, in words with units and as JSON."""

import json
import math

import pytest
from attrs import evolve
from cases import every_case
from test_classifiers import NAMES, UNITS, fitted, learned, trials

from graspsense.core.values.features import Features, Prediction
from graspsense.core.values.reasons import FeatureValue, Reason, contribution_reasons

FULL_CAN = Features(names=NAMES, values=(0.0661, 8.0, 0.0), units=UNITS)
MISSING = Features(names=NAMES, values=(0.0661, math.nan, 0.0), units=UNITS, reasons={"f_steady": "no rest"})


SHAPLEY = ("knn", "svm", "mlp", "backprop")
LOG_ODDS = ("boosted", "ebm")
EVERY = ["forest", "boosted", *SHAPLEY, pytest.param("ebm", marks=pytest.mark.slow)]
UNFINISHED = pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")


@UNFINISHED
@pytest.mark.parametrize("name", EVERY)
@every_case("classes", [2, 3])
def test_contributions_add_up_to_the_probability_or_to_the_logarithm_of_the_odds(name, classes):
    table, labels = trials(missing=0.1)
    if classes == 2:
        labels = [label.partition(":")[0] for label in labels]
    classifier = fitted(name, table, labels)
    for features in (FULL_CAN, MISSING, evolve(FULL_CAN, values=(0.0580, 8.0, 0.0))):
        said = classifier.explain(features)
        given = [reason.contribution for reason in said.because if reason.contribution is not None]
        total, share = math.fsum(contribution.value for contribution in given), said.probabilities[said.label]
        if name in LOG_ODDS:
            other = sorted(said.probabilities, key=said.probabilities.get)[-2]
            odds = share / said.probabilities[other]
            assert odds >= 1.0
            assert total == pytest.approx(math.log(odds), abs=1e-9)
            assert {(each.scale, each.label) for each in given} == {("log-odds", said.label)}
            assert given[0].against == other
        else:
            assert total == pytest.approx(share, abs=1e-9)
            assert {(each.scale, each.label) for each in given} == {("probability", said.label)}
        # The median stands for a missing feature, so it contributes nothing.
        if name in SHAPLEY:
            missing = FeatureValue("f_steady", None, "N")
            assert all(missing not in reason.features for reason in said.because if reason.contribution)


@UNFINISHED
@pytest.mark.parametrize("name", EVERY)
def test_the_feature_that_tells_the_labels_apart_contributes_most(name):
    largest = learned(name).explain(FULL_CAN).because[0]
    assert largest.features == (FeatureValue("p_first", 0.0661, "m"),)
    assert largest.words.startswith("p_first = 66.1 mm: ")
    assert largest.contribution.value > 0.0


def test_words_of_contributions_are_points_or_factors_of_the_odds():
    width, value = FeatureValue("p_first", 0.0661, "m"), FeatureValue("f_steady", None, "N")
    parts = [((width,), 0.25), ((value,), -1e-9)]
    shares = contribution_reasons(parts, 0.3, scale="probability", label="can")
    parts = [((width,), -math.log(4.0)), ((width, value), math.log(10.0))]
    odds = contribution_reasons(parts, 0.0, scale="log-odds", label="can", against="jar")
    assert [share.words for share in shares] == [
        "p_first = 66.1 mm: +25.0 points",
        "f_steady is missing: +0.0 points",
        "before any feature: 30.0 % for can",
    ]
    assert [odd.words for odd in odds] == [
        "p_first = 66.1 mm and f_steady is missing: odds of can to jar × 10",
        "p_first = 66.1 mm: odds of can to jar ÷ 4",
        "before any feature: odds of can to jar × 1",
    ]


def test_smaller_contributions_are_told_together_and_still_add_up():
    parts = [((FeatureValue(f"f{k}", float(k), "N"),), 0.01 * k) for k in range(1, 11)]

    reasons = contribution_reasons(parts, 0.2, scale="probability", label="can")

    assert [reason.words.partition(" =")[0] for reason in reasons[:5]] == ["f10", "f9", "f8", "f7", "f6"]
    assert reasons[5].words == "5 smaller contributions together: +15.0 points"
    assert len(reasons[5].features) == 5
    assert math.fsum(reason.contribution.value for reason in reasons) == pytest.approx(0.75)


def test_a_text_becomes_a_reason():
    said = Prediction(label="can", probabilities={"can": 1.0}, because=("nearest to the mean of can",))
    assert said.because == (Reason(words="nearest to the mean of can"),)
    assert said.as_json()["because"] == [{"words": "nearest to the mean of can"}]


@pytest.mark.parametrize("name", ["forest", "c45", "knn", "tree"])
def test_json_has_what_a_reason_has(name):
    listed = json.loads(json.dumps(learned(name).explain(MISSING).as_json()))["because"]
    assert all(reason["words"] for reason in listed)
    missing = [reason for reason in listed if "is missing" in reason["words"]]
    assert missing[0]["features"][0] == {"name": "f_steady", "value": None, "unit": "N"}
    if name in ("c45", "tree"):
        assert any("rule" in reason for reason in listed)
    else:
        assert any(reason.get("contribution", {}).get("label") == "can:full" for reason in listed)
