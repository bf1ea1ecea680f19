"""A unit does not decide what the classifier can tell apart; as a library, the tree is J48's, with its 1e-5."""

import numpy as np
from cases import every_case

from graspsense.plugin_api import FeatureTable
from graspsense_c45.plugin import C45, C45Config


def fitted(values, labels):
    classifier = C45(C45Config())
    classifier.fit(FeatureTable(names=("c",), units=("F",), values=np.array(values)[:, None]), labels, 0)
    return classifier


def lengths():
    rng = np.random.default_rng(1)
    return [*rng.normal(6.0, 0.5, 30), *rng.normal(9.0, 1.0, 30)], ["stiff"] * 30 + ["soft"] * 30


@every_case("exponent", [-80, -30, -14, -3])
def test_the_tree_is_the_same_in_every_unit(exponent):
    values, labels = lengths()
    small = fitted(np.ldexp(values, exponent), labels)
    large = fitted(values, labels)
    assert len(small.tree()) > 1
    assert [node.trials for node in small.tree()] == [node.trials for node in large.tree()]
    wanted = np.ldexp(large._fitted().splits.threshold, exponent)
    np.testing.assert_array_equal(small._fitted().splits.threshold, wanted)
    table = FeatureTable(names=("c",), units=("F",), values=np.ldexp(values, exponent)[:, None])
    restored = C45(C45Config())
    restored.from_json(small.to_json())
    np.testing.assert_array_equal(restored.probabilities(table), small.probabilities(table))


def test_what_varies_only_by_rounding_is_not_scaled():
    values = np.where(np.arange(40) % 2, 0.3, 0.1 + 0.2)
    assert len(fitted(values, ["a", "b"] * 20).tree()) == 1
