"""Shapley values: those of the definition, that add up to the probability, for classifiers without a structure."""

import math
from itertools import permutations

import numpy as np
import pytest
from cases import every_case
from test_classifiers import fitted, trials
from test_reasons import FULL_CAN, MISSING, total

from graspsense.core.values.reasons import FeatureValue
from graspsense.plugins.classifiers.shapley import shapley_values

NAMES = ("svm", "mlp", "backprop", "knn")


def interacting(rows):
    """A function in which the contribution of a feature depends on the others."""
    return (
        0.1
        + 0.2 * rows[:, 0] * rows[:, 1]
        + 0.3 * np.maximum(rows[:, 2], rows[:, 0])
        + 0.01 * rows.sum(axis=1)
    )


def by_definition(trial, medians):
    orders = list(permutations(range(len(trial))))
    parts = np.zeros(len(trial))
    for order in orders:
        row = medians.copy()
        for k in order:
            base = interacting(row[np.newaxis])[0]
            row[k] = trial[k]
            parts[k] += (interacting(row[np.newaxis])[0] - base) / len(orders)
    return parts


def test_few_features_have_the_values_of_the_definition():
    trial, medians = np.array([1.0, 2.0, 0.5, -1.0, 0.0]), np.zeros(5)

    start, parts = shapley_values(interacting, trial, medians)

    assert start == pytest.approx(0.1)
    assert parts == pytest.approx(by_definition(trial, medians), abs=1e-12)
    assert parts[4] == 0.0


def test_many_features_are_sampled_alike_in_every_call_and_add_up():
    rng = np.random.default_rng(0)
    trial, medians = rng.normal(size=20), np.zeros(20)
    # Only the first three interact, so the definition needs the orders of these alone.
    expected = by_definition(trial[:3], medians[:3])

    start, parts = shapley_values(interacting, trial, medians)

    assert start + math.fsum(parts) == pytest.approx(interacting(trial[np.newaxis])[0], abs=1e-12)
    assert parts[:3] == pytest.approx(expected, abs=0.1)
    assert parts[3:] == pytest.approx((0.01 * trial[3:]).tolist(), abs=1e-12)
    assert shapley_values(interacting, trial, medians) == (start, parts)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@every_case("name", NAMES)
@every_case("features", [FULL_CAN, MISSING])
def test_contributions_add_up_to_the_probability(name, features):
    said = fitted(name, *trials(missing=0.1)).explain(features)

    given = [reason for reason in said.because if reason.contribution is not None]
    assert total(said) == pytest.approx(said.probabilities[said.label], abs=1e-9)
    assert {(reason.contribution.scale, reason.contribution.label) for reason in given} == {
        ("probability", said.label)
    }
    # The median stands for a missing feature, so it contributes nothing.
    assert all(FeatureValue("f_steady", None, "N") not in reason.features for reason in given)


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@every_case("name", NAMES)
def test_the_feature_that_tells_the_labels_apart_contributes_most(name):
    reason = fitted(name, *trials()).explain(FULL_CAN).because[0]

    assert reason.features == (FeatureValue("p_first", 0.0661, "m"),)
    assert reason.words.startswith("p_first = 66.1 mm: +")
