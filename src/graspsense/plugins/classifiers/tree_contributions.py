"""Contributions of features to the output of decision trees, by exact decomposition of the paths.

The output of a tree is the mean over the training trials, at the root, plus the change of the mean at each test on the
path; a change is counted for the tested feature. The sum is the output exactly (A. Saabas, treeinterpreter, 2014;
S. M. Lundberg et al., Nat. Mach. Intell. 2 (2020) 56, discuss how it differs from Shapley values).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


def path_contributions(
    trees: Sequence[Any], means: Sequence[NDArray[np.float64]], row: NDArray[np.float64]
) -> tuple[float, list[float]]:
    """Return the sum of the outputs at the roots, and the sum of the changes for each feature.

    `trees` are the `tree_` of fitted trees of scikit-learn, `means` their outputs at each node; `row` is one
    preprocessed trial of shape (1, features).
    """
    start, parts = 0.0, [0.0] * row.shape[1]
    trial = row.astype(np.float32)  # as the trees compare it with their thresholds
    for tree, mean in zip(trees, means, strict=True):
        left, right, feature = tree.children_left, tree.children_right, tree.feature
        node, output = 0, float(mean[0])
        start += output
        while left[node] >= 0:
            tested = int(feature[node])
            node = int(left[node] if trial[0, tested] <= tree.threshold[node] else right[node])
            parts[tested] += float(mean[node]) - output
            output = float(mean[node])
    return start, parts


def means_from_leaves(tree: Any) -> NDArray[np.float64]:
    """Return the mean output at each node of a regression tree, weighted by training trials, from its leaves.

    A boosted tree has new outputs at its leaves after it is grown; those of the inner nodes are still the old ones.
    """
    means: NDArray[np.float64] = tree.value[:, 0, 0].copy()
    weights = tree.weighted_n_node_samples
    for node in range(tree.node_count - 1, -1, -1):  # children have larger numbers than their parent
        children = [tree.children_left[node], tree.children_right[node]]
        if children[0] >= 0:
            means[node] = weights[children] @ means[children] / weights[children].sum()
    return means
