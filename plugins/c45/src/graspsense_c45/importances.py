"""How much each attribute contributes to a tree."""

from __future__ import annotations

import numpy as np

from graspsense_c45.arithmetic import LN2, x_ln_x
from graspsense_c45.arrays import Reals
from graspsense_c45.tree import Tree


def feature_importances(tree: Tree) -> Reals:
    """Return the fraction of each attribute in the information gain of the tree on its training weight.

    The fractions add up to 1; all are 0 where the tree gains no information. The impurity of a node is its entropy.
    """
    classes = np.array([[x_ln_x(weight) for weight in row] for row in tree.class_weights.tolist()]).sum(
        axis=1
    )
    whole = np.array([x_ln_x(weight) for weight in tree.weighted_n_node_samples.tolist()])
    weighted_impurity = (whole - classes) / LN2
    gained = np.zeros(len(tree.schema.attributes))
    for node in range(tree.node_count):
        if not tree.is_leaf(node):
            children = list(tree.children(node))
            gained[tree.splits.feature[node]] += weighted_impurity[node] - weighted_impurity[children].sum()
    gained = np.maximum(gained, 0.0)
    return np.asarray(gained / gained.sum() if gained.any() else gained)
