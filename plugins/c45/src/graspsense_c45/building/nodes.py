"""The nodes of a tree that is grown and pruned."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from graspsense_c45.arithmetic import first_maximum
from graspsense_c45.arrays import Integers, IntegerTable, Numbers
from graspsense_c45.tree import ALL_VALUES, LEAF


class Nodes(NamedTuple):
    """The nodes of a tree while it is grown and pruned; see `tree.Splits`.

    counts: nodes x classes, the fixed-point weight at each node.
    """

    feature: Integers
    threshold: Numbers
    category: Integers
    first_child: Integers
    n_children: Integers
    counts: IntegerTable


def make_leaf(node: int, nodes: Nodes) -> None:
    """Make a node a leaf."""
    nodes.feature[node] = LEAF
    nodes.threshold[node] = np.nan
    nodes.category[node] = ALL_VALUES
    nodes.first_child[node] = nodes.n_children[node] = 0


def replace(node: int, by: int, nodes: Nodes) -> None:
    """Give a node the split and the children of another one; the counts of the node stay."""
    nodes.feature[node] = nodes.feature[by]
    nodes.threshold[node] = nodes.threshold[by]
    nodes.category[node] = nodes.category[by]
    nodes.first_child[node] = nodes.first_child[by]
    nodes.n_children[node] = nodes.n_children[by]


def weight_of(counts: Integers) -> int:
    """Return the weight of all classes."""
    weight = 0
    for k in range(len(counts)):
        weight += counts[k]
    return weight


def training_errors(counts: Integers, margin: int) -> int:
    """Return the weight outside the majority class; `margin` is that of `training_set.TrainingSet.weight_margin`."""
    return weight_of(counts) - int(counts[first_maximum(counts, 0, margin)])
