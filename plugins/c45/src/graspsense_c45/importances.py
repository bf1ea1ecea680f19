"""How much each attribute tells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from graspsense_c45.arithmetic import LN2, x_ln_x_array
from graspsense_c45.tree import Tree


def feature_importances(tree: Tree) -> NDArray[np.float64]:
    """The share of each attribute in the information the tree gains on its training weight; they add up to 1.

    All are 0 where the tree gains nothing.
    """
    uncertainty = (x_ln_x_array(tree.weight) - x_ln_x_array(tree.weights).sum(axis=1)) / LN2
    gained = np.zeros(len(tree.schema.attributes))
    for node in range(tree.n_nodes):
        if not tree.is_leaf(node):
            sons = list(tree.sons(node))
            gained[tree.tests.attribute[node]] += uncertainty[node] - uncertainty[sons].sum()
    gained = np.maximum(gained, 0.0)
    return np.asarray(gained / gained.sum() if gained.any() else gained)
