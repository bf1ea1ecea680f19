"""Every classifier behind the role: c45 from its own distribution, the others scikit-learn's.

What the role itself asks for, such as valid probabilities and reasons that fit them, `test_our_parts` checks.
"""

import json
import math
from functools import cache

import numpy as np
import pytest
from attrs import evolve
from cases import every_case

from graspsense.core.values.features import Features, FeatureTable
from graspsense.plugin_api import create

ALL = ["c45", "svm", "mlp", "backprop", "forest", "extra-trees", "boosted", "ebm", "knn", "tree"]
NAMES, UNITS = ("p_first", "f_steady", "noise"), ("m", "N", "")


def trials(n=40, seed=0, missing=0.0):
    """Two bottles and a can: width and force tell them apart, the third feature nothing."""
    rng = np.random.default_rng(seed)
    labels = [("bottle:full", "bottle:empty", "can:full")[i % 3] for i in range(3 * n)]
    centre = {"bottle:full": (0.058, 8.0), "bottle:empty": (0.058, 5.0), "can:full": (0.066, 8.0)}
    values = np.array([(*centre[label], 0.0) for label in labels])
    values += rng.normal(size=values.shape) * (0.0005, 0.3, 1.0)
    values[rng.random(values.shape) < missing] = np.nan
    return FeatureTable(names=NAMES, units=UNITS, values=values), labels


FAST = {
    "ebm": {"bags": 1, "pairs": 1},
    "boosted": {"stages": 10},
    "forest": {"trees": 10},
    "extra-trees": {"trees": 10},
    "backprop": {"epochs": 60},
}
"""Settings of the classifiers that are slow to fit."""


def fitted(name, table, labels, seed=0, **config):
    config = {**FAST.get(name, {}), **config}
    classifier = create("classifier", name, **config)
    classifier.fit(table, labels, seed)
    return classifier


@cache
def learned(name):
    """Return a classifier that has learned the trials of seed 0; the tests that share it only ask it."""
    return fitted(name, *trials())


def rate(classifier, table, labels):
    answers = classifier.probabilities(table).argmax(axis=1)
    return np.mean([classifier.classes()[k] == label for k, label in zip(answers, labels, strict=True)])


def stored(name, classifier, **config):
    """Return a classifier as it comes back from JSON, in which it is the same."""
    again = create("classifier", name, **config)
    again.from_json(json.loads(json.dumps(classifier.to_json(), allow_nan=False)))
    assert again.to_json() == classifier.to_json()
    return again


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")  # mlp, on few trials
@pytest.mark.parametrize("name", ALL)
class TestEvery:
    def test_it_learns_what_can_be_learned_whatever_the_order_of_columns(self, name):
        classifier = learned(name)
        table, labels = trials(seed=1)
        assert set(classifier.classes()) == set(labels)
        assert rate(classifier, table, labels) > 0.95
        turned = table.columns(("noise", "p_first", "f_steady"))
        assert (classifier.probabilities(turned) == classifier.probabilities(table)).all()

    def test_missing_values_in_training_and_in_a_trial_have_an_answer(self, name):
        learned_with_gaps = fitted(name, *trials(missing=0.2), seed=3)
        table, labels = trials(seed=1, missing=0.1)
        # As a model that was stored answers them.
        classifier = stored(name, learned_with_gaps, **FAST.get(name, {}))
        assert (classifier.probabilities(table) == learned_with_gaps.probabilities(table)).all()
        assert classifier.explain(table.row(0)) == learned_with_gaps.explain(table.row(0))
        assert rate(classifier, table, labels) > 0.75
        reason = {"f_steady": "the fingers never came to rest"}
        row = Features(names=NAMES, values=(0.0661, math.nan, 0.0), units=UNITS, reasons=reason)
        said = classifier.explain(row)
        assert said.label == "can:full"
        missing = [words for words in (each.words for each in said.because) if "f_steady is missing" in words]
        assert any("came to rest" in words for words in missing)

    def test_a_feature_that_no_trial_had_and_one_that_is_constant(self, name):
        table, labels = trials()
        values = np.column_stack((table.values, np.full(len(labels), np.nan), np.full(len(labels), 7.0)))
        wide = FeatureTable(names=(*NAMES, "none", "same"), units=(*UNITS, "", ""), values=values)
        classifier = fitted(name, wide, labels)
        assert rate(classifier, wide, labels) > 0.95
        assert np.isfinite(classifier.probabilities(wide)).all()
        # What training never saw change tells nothing, in newtons as in millinewtons.
        other = evolve(wide, values=wide.values * (1.0, 1.0, 1.0, 1.0, 1000.0))
        assert (classifier.probabilities(other) == classifier.probabilities(wide)).all()

    @pytest.mark.filterwarnings("error::RuntimeWarning")
    @every_case("factor", [1e-320, 1e-310, 1e90])
    def test_values_of_any_size_are_told_apart(self, name, factor):
        """Those below the square root of the least number may count as constant; the answer is still one."""
        table, labels = trials()
        table = evolve(table, values=table.values * factor)
        classifier = fitted(name, table, labels)
        assert classifier.probabilities(table).sum(axis=1) == pytest.approx(np.ones(len(labels)))
        assert factor == 1e-320 or rate(classifier, table, labels) > 0.95


@every_case("kept", [("bottle:full", "can:full"), ("bottle:empty", "bottle:full", "can:full")])
def test_the_weights_of_a_network_are_the_network(kept):
    table, labels = trials()
    table = evolve(table, values=table.values * (1.0, 1.0, 0.0))
    rows = np.flatnonzero(np.isin(labels, kept))
    network = fitted("mlp", table.rows(rows), [labels[i] for i in rows], kept_as="weights")
    again = stored("mlp", network, kept_as="weights")
    assert "trials" not in network.to_json()
    assert again.classes() == network.classes()
    assert (again.probabilities(table) == network.probabilities(table)).all()


def test_another_version_of_scikit_learn_is_said():
    kept = fitted("knn", *trials()).to_json()
    again = create("classifier", "knn")
    again.from_json({**kept, "made_with": "scikit-learn 0.1"})

    (warning,) = again.explain(trials()[0].row(0)).warnings
    assert "made with scikit-learn 0.1 and made" in warning


def test_trees_tell_their_path_in_the_features_own_units_and_neighbours_their_votes():
    row = Features(names=NAMES, values=(0.0661, 8.0, 0.0), units=UNITS)
    for name in ("c45", "tree"):
        *path, last = (reason.words for reason in learned(name).explain(row).because)
        assert any(words.startswith("p_first = 66.1 mm > ") and words.endswith(" mm") for words in path)
        assert "training trials" in last
    last = fitted("knn", *trials(), neighbours=7).explain(row).because[-1].words
    assert last.startswith("7 of the 7 nearest training trials are can:full; the nearest is ")


def test_more_neighbours_than_trials():
    table, labels = trials(n=1)
    assert fitted("knn", table, labels, neighbours=50).probabilities(table).shape == (3, 3)


def test_a_machine_with_the_range_as_scale_does_not_depend_on_units_and_fits_less_than_with_deviations():
    table, labels = trials(missing=0.1)
    metres = fitted("svm", table, labels, scaling="range", kernel="linear", c=1.0)
    millimetres = FeatureTable(names=NAMES, units=UNITS, values=table.values * (1e3, 1.0, 1.0))
    same = fitted("svm", millimetres, labels, scaling="range", kernel="linear", c=1.0)

    assert metres.probabilities(table) == pytest.approx(same.probabilities(millimetres), abs=1e-6)
    ready = metres._fitted.scaling.ready(table.values)
    assert (ready.min(axis=0), ready.max(axis=0)) == (pytest.approx(np.zeros(3)), pytest.approx(np.ones(3)))


def test_the_network_takes_the_steps_of_the_published_rule():
    from graspsense.plugins.classifiers.backprop import train

    x, wanted = np.array([[0.5, 1.0], [-0.25, 1.0]]), np.array([[1.0, 0.0], [0.0, 1.0]])
    hidden, output = np.array([[0.1, -0.2]]), np.array([[0.3, 0.1], [-0.1, 0.2]])

    def loss(weights, i):
        w1, w2 = weights[:2].reshape(1, 2), weights[2:].reshape(2, 2)
        felt = np.append(1 / (1 + np.exp(-w1 @ x[i])), 1.0)
        return 0.5 * np.sum((wanted[i] - 1 / (1 + np.exp(-w2 @ felt))) ** 2)

    # The gradient by differences, a step for each trial, and a share of the step before.
    weights, change = np.concatenate((hidden.ravel(), output.ravel())), np.zeros(6)
    for i in (0, 1, 0, 1):
        slope = [(loss(weights + d, i) - loss(weights - d, i)) / 2e-5 for d in 1e-5 * np.eye(6)]
        change = -0.3 * np.array(slope) + 0.2 * change
        weights = weights + change
    layers = train(x, wanted, hidden, output, (0.3, 0.2), 2)

    assert np.concatenate([layer.ravel() for layer in layers]) == pytest.approx(weights, abs=1e-9)


def test_the_network_has_half_as_many_units_as_features_and_labels():
    assert learned("backprop")._fitted.estimator._hidden.shape == (3, 4)
