"""Why a row was called what it was called: its path through the tree, in words and units."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from graspsense_c45.branch_words import branch, with_unit
from graspsense_c45.numbers_as_text import short
from graspsense_c45.prediction import class_indices, distributions
from graspsense_c45.tree import Tree


@dataclass(frozen=True, slots=True)
class Path:
    """The way of one row from the root to a leaf.

    steps: one test each, such as ``delta_t 0.61 s > 0.542 s``. label, probability: the prediction for the row.
    support: training weight at the leaf. Where a tested value is missing the prediction blends all branches; the path
    then follows the heaviest one, and its step says so.
    """

    steps: tuple[str, ...]
    label: str | int | float | bool
    probability: float
    support: float

    def __str__(self) -> str:
        """All in one line."""
        reasons = " and ".join(self.steps) if self.steps else "no test"
        return f"{self.label} ({self.probability:.2f}) because {reasons}"


def explain(tree: Tree, row: Sequence[float]) -> Path:
    """The path of one row (a number for each attribute, NaN where missing, the index of a nominal value).

    Raises ValueError as ``distributions`` does.
    """
    values = np.array([row], dtype=np.float64)
    shares = distributions(tree, values, "numpy")[0]
    chosen = int(class_indices(tree, values, "numpy")[0])
    node, steps = 0, []
    while not tree.is_leaf(node):
        tested = values[0, tree.tests.attribute[node]]
        slot = int(tree.tests.slot(np.array([node]), np.array([tested]))[0])
        if slot < 0:
            slot = int(np.argmax(tree.weight[tree.sons(node)]))
            share = tree.weight[tree.sons(node)[slot]] / tree.weight[node]
            steps.append(
                f"{tree.attribute(node).name} missing ({branch(tree, node, slot)} in {share:.0%} of training)"
            )
        else:
            steps.append(_step(tree, node, slot, float(tested)))
        node = tree.sons(node)[slot]
    return Path(tuple(steps), tree.schema.classes[chosen], float(shares[chosen]), float(tree.weight[node]))


def _step(tree: Tree, node: int, slot: int, tested: float) -> str:
    attribute = tree.attribute(node)
    if attribute.values is not None:
        one = int(tree.tests.value[node])
        value = attribute.values[int(tested)]
        return (
            f"{attribute.name} {value} != {attribute.values[one]}"
            if slot and one >= 0
            else f"{attribute.name} = {value}"
        )
    threshold = float(tree.tests.threshold[node])
    number = with_unit(short(tested, threshold), attribute)
    return (
        f"{attribute.name} {number} {'>' if slot else '<='} {with_unit(short(threshold, tested), attribute)}"
    )
