"""Reasons of predictions: contributions add up to the prediction, in words with units and as JSON."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from cases import every_case
from test_classifiers import NAMES, UNITS, fitted, trials

from graspsense.core.values.features import Features, FeatureTable, Prediction
from graspsense.core.values.reasons import FeatureValue, Reason, contribution_reasons
from graspsense.plugin_api import create

FULL_CAN = Features(names=NAMES, values=(0.0661, 8.0, 0.0), units=UNITS)
MISSING = Features(names=NAMES, values=(0.0661, math.nan, 0.0), units=UNITS, reasons={"f_steady": "no rest"})


def total(said):
    return math.fsum(reason.contribution.value for reason in said.because if reason.contribution is not None)


def test_contributions_of_a_forest_add_up_to_the_probability():
    classifier = fitted("forest", *trials(missing=0.1), trees=10)
    for features in (FULL_CAN, MISSING):
        said = classifier.explain(features)

        assert total(said) == pytest.approx(said.probabilities[said.label], abs=1e-12)
        given = [reason for reason in said.because if reason.contribution is not None]
        assert {reason.contribution.scale for reason in given} == {"probability"}
        assert given[-1].words.startswith("before any feature: 3")
        assert given[-1].words.endswith(" % for can:full")


@pytest.mark.parametrize("name", ["boosted", pytest.param("ebm", marks=pytest.mark.slow)])
@every_case("classes", [2, 3])
def test_contributions_in_log_odds_add_up_to_the_odds(name, classes):
    table, labels = trials(missing=0.1)
    if classes == 2:
        labels = [label.partition(":")[0] for label in labels]
    classifier = fitted(name, table, labels)

    for value in (0.0661, 0.0580):
        said = classifier.explain(Features(names=NAMES, values=(value, 8.0, 0.0), units=UNITS))
        given = [reason.contribution for reason in said.because if reason.contribution is not None]
        odds = said.probabilities[said.label] / said.probabilities[given[0].against]
        assert total(said) == pytest.approx(math.log(odds), abs=1e-9)
        assert odds >= 1.0
        assert {contribution.label for contribution in given} == {said.label}
        assert given[0].against == sorted(said.probabilities, key=said.probabilities.get)[-2]


@pytest.mark.parametrize("name", ["forest", "boosted", pytest.param("ebm", marks=pytest.mark.slow)])
def test_the_feature_that_tells_the_labels_apart_contributes_most(name):
    said = fitted(name, *trials()).explain(FULL_CAN)
    largest = said.because[0]

    assert largest.features == (FeatureValue("p_first", 0.0661, "m"),)
    assert largest.words.startswith("p_first = 66.1 mm: ")
    assert largest.contribution.value > 0.0
    assert all(reason.features[0].name != "noise" for reason in said.because[:1])


def test_words_of_contributions_are_points_or_factors_of_the_odds():
    width = FeatureValue("p_first", 0.0661, "m")
    value = FeatureValue("f_steady", None, "N")

    shares = contribution_reasons(
        [((width,), 0.25), ((value,), -1e-9)], 0.3, scale="probability", label="can"
    )
    odds = contribution_reasons(
        [((width,), -math.log(4.0)), ((width, value), math.log(10.0))],
        0.0,
        scale="log-odds",
        label="can",
        against="jar",
    )

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


SLOWER = ("boosted", "ebm", "mlp", "backprop", "svm")


@pytest.mark.parametrize(
    "name", ["forest", "c45", "knn", "tree", *(pytest.param(name, marks=pytest.mark.slow) for name in SLOWER)]
)
def test_json_has_what_a_reason_has(name):
    listed = json.loads(json.dumps(fitted(name, *trials()).explain(MISSING).as_json()))["because"]
    assert all(reason["words"] for reason in listed)
    missing = [reason for reason in listed if "is missing" in reason["words"]]
    assert missing[0]["features"][0] == {"name": "f_steady", "value": None, "unit": "N"}
    if name in ("c45", "tree"):
        assert any("rule" in reason for reason in listed)
    else:
        assert any(reason.get("contribution", {}).get("label") == "can:full" for reason in listed)


def test_a_boosted_model_comes_back_from_json_with_its_settings():
    table, labels = trials()
    classifier = fitted("boosted", table, labels, stages=20, depth=2, sample=0.7, seed=4)
    again = create("classifier", "boosted", stages=20, depth=2, sample=0.7)
    again.from_json(json.loads(json.dumps(classifier.to_json())))

    wide = FeatureTable(names=NAMES, units=UNITS, values=table.values + np.array([1e-4, 0.1, 0.0]))
    assert (again.probabilities(wide) == classifier.probabilities(wide)).all()
