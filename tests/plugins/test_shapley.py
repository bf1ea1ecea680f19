"""Shapley values: those of the definition, that add up to the probability, for classifiers without a structure."""

import math
from itertools import permutations

import numpy as np
import pytest

from graspsense.plugins.classifiers.shapley import shapley_values


def interacting(rows):
    """A function in which the contribution of a feature depends on the others."""
    a, b, c = rows[:, :3].T
    return 0.1 + 0.2 * a * b + 0.3 * np.maximum(c, a) + 0.01 * rows.sum(axis=1)


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
