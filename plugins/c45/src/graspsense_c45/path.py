"""Why a row has its prediction: the path of the row through the tree, in words and units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from graspsense_c45.branch_words import branch, with_unit
from graspsense_c45.numbers_as_text import short
from graspsense_c45.prediction import class_indices, distributions
from graspsense_c45.schema import Attribute
from graspsense_c45.tree import Tree, largest_class


@frozen
class NumericTest:
    """A test of a numeric attribute: the value of the row, NaN if it is missing, and whether it is above the threshold.

    share: the part of the training weight that took the same branch.
    """

    attribute: Attribute
    value: float
    threshold: float
    above: bool
    share: float


@frozen
class NominalTest:
    """A test of a nominal attribute: the place of the value of the row, NaN if it is missing, and the test in words."""

    attribute: Attribute
    value: float
    words: str


@frozen
class Path:
    """The path of a row from the root to a leaf.

    steps: one test each, such as ``delta_t 0.61 s > 0.542 s``. label, probability: the prediction for the row.
    support: the training weight at the leaf, in rows. Where a tested value is missing, the prediction is a mean over
    all branches; the path follows the heaviest branch, and the step says so. numeric_tests: the tests of numeric
    attributes among the steps, as numbers. nominal_tests: those of nominal ones. with_label: the training weight at the
    leaf that has the label. distribution: the probability of each class.
    """

    steps: tuple[str, ...]
    label: str | int | float | bool
    probability: float
    support: float
    numeric_tests: tuple[NumericTest, ...] = ()
    nominal_tests: tuple[NominalTest, ...] = ()
    with_label: float = 0.0
    distribution: tuple[float, ...] = ()

    def __str__(self) -> str:
        """Return the prediction and the steps in one line."""
        reasons = " and ".join(self.steps) if self.steps else "no test"
        return f"{self.label} ({self.probability:.2f}) because {reasons}"


def explain(tree: Tree, row: Sequence[float]) -> Path:
    """Return the path of a row: a number for each attribute, NaN where missing, the index of a nominal value.

    Raises ValueError as `prediction.distributions` does.
    """
    values = np.array([row], dtype=np.float64)
    shares = distributions(tree, values)[0]
    # Without smoothing, the largest probability is that of the class: the row is routed once.
    of_class = largest_class(shares[None]) if not tree.laplace else class_indices(tree, values)
    chosen = int(of_class[0])
    node, steps, tests, nominal = 0, [], [], []
    while not tree.is_leaf(node):
        tested = values[0, tree.splits.feature[node]]
        slot = int(tree.splits.slot(np.array([node]), np.array([tested]))[0])
        if slot < 0:
            slot = int(np.argmax(tree.weighted_n_node_samples[tree.children(node)]))
            share = _share(tree, node, slot)
            steps.append(
                f"{tree.attribute(node).name} missing ({branch(tree, node, slot)} in {100 * share:.0f} % of training)"
            )
        else:
            steps.append(_step(tree, node, slot, float(tested)))
        attribute = tree.attribute(node)
        if not attribute.is_nominal:
            threshold = float(tree.splits.threshold[node])
            tests.append(
                NumericTest(attribute, float(tested), threshold, slot == 1, _share(tree, node, slot))
            )
        else:
            nominal.append(NominalTest(attribute, float(tested), steps[-1]))
        node = tree.children(node)[slot]
    return Path(
        tuple(steps),
        tree.schema.classes[chosen],
        float(shares[chosen]),
        float(tree.weighted_n_node_samples[node]),
        tuple(tests),
        tuple(nominal),
        float(tree.class_weights[node, chosen]),
        tuple(shares.tolist()),
    )


def _share(tree: Tree, node: int, slot: int) -> float:
    weights = tree.weighted_n_node_samples
    return float(weights[tree.children(node)[slot]] / weights[node])


def _step(tree: Tree, node: int, slot: int, tested: float) -> str:
    attribute = tree.attribute(node)
    if attribute.values is not None:
        category = int(tree.splits.category[node])
        value = attribute.values[int(tested)]
        return (
            f"{attribute.name} {value} != {attribute.values[category]}"
            if slot and category >= 0
            else f"{attribute.name} = {value}"
        )
    threshold = float(tree.splits.threshold[node])
    number = with_unit(short(tested, threshold), attribute)
    return (
        f"{attribute.name} {number} {'>' if slot else '<='} {with_unit(short(threshold, tested), attribute)}"
    )
