"""Why a row has its prediction: the path of the row through the tree, in words and units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from graspsense_c45.branch_words import branch, short, with_unit
from graspsense_c45.prediction import class_indices, distributions
from graspsense_c45.table import Attribute
from graspsense_c45.tree import Tree, largest_class


@frozen
class PathTest:
    """A test on the path of a row.

    words: such as ``delta_t 0.61 s > 0.542 s``. value: of the row, NaN if it is missing; of a nominal attribute its
    place. threshold: NaN for a nominal attribute. above: whether the value is above it. share: the part of the training
    weight that took the same branch.
    """

    attribute: Attribute
    words: str
    value: float
    threshold: float
    above: bool
    share: float


@frozen
class Path:
    """The path of a row from the root to a leaf.

    label, probability: the prediction for the row. support: the training weight at the leaf, in rows. Where a tested
    value is missing, the prediction is a mean over all branches; the path follows the heaviest branch, and the words of
    the test say so. with_label: the training weight at the leaf that has the label. distribution: the probability of
    each class.
    """

    tests: tuple[PathTest, ...]
    label: str | int | float | bool
    probability: float
    support: float
    with_label: float
    distribution: tuple[float, ...]

    @property
    def steps(self) -> tuple[str, ...]:
        """The tests in words."""
        return tuple(test.words for test in self.tests)

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
    node, tests = 0, []
    while not tree.is_leaf(node):
        tested = float(values[0, tree.splits.feature[node]])
        slot = int(tree.splits.slot(np.array([node]), np.array([tested]))[0])
        missing = slot < 0
        if missing:
            slot = int(np.argmax(tree.weighted_n_node_samples[tree.children(node)]))
        attribute, share = tree.attribute(node), _share(tree, node, slot)
        if missing:
            words = (
                f"{attribute.name} missing ({branch(tree, node, slot)} in {100 * share:.0f} % of training)"
            )
        else:
            words = _step(tree, node, slot, tested)
        above = slot == 1 and not attribute.is_nominal
        tests.append(PathTest(attribute, words, tested, float(tree.splits.threshold[node]), above, share))
        node = tree.children(node)[slot]
    return Path(
        tests=tuple(tests),
        label=tree.schema.classes[chosen],
        probability=float(shares[chosen]),
        support=float(tree.weighted_n_node_samples[node]),
        with_label=float(tree.class_weights[node, chosen]),
        distribution=tuple(shares.tolist()),
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
