"""The tree as a matplotlib drawing (needs the extra ``plot``)."""

from __future__ import annotations

from typing import Any

import numpy as np

from graspsense_c45.branch_words import branch, label_text
from graspsense_c45.tree import Tree


def draw(tree: Tree, axes: Any = None) -> Any:
    """Draw the tree into matplotlib axes (new ones where None) and return them: leaves evenly spaced, root on top."""
    import matplotlib.pyplot as plt

    x, y = _places(tree)
    if axes is None:
        size = (max(4.0, 1.3 * tree.n_leaves), max(2.5, 1.1 * (tree.depth + 1)))
        axes = plt.figure(figsize=size, layout="constrained").add_subplot()
    axes.set_axis_off()
    axes.set_xlim(-0.6, tree.n_leaves - 0.4)
    axes.set_ylim(-tree.depth - 0.4, 0.4)
    colours: Any = plt.get_cmap("tab20")
    for node in range(tree.n_nodes):
        for slot, son in enumerate(tree.sons(node)):
            axes.plot([x[node], x[son]], [y[node], y[son]], color="0.6", linewidth=1, zorder=1)
            words = branch(tree, node, slot).removeprefix(tree.attribute(node).name).strip()
            middle = (x[node] + x[son]) / 2, (y[node] + y[son]) / 2
            axes.text(*middle, words, ha="center", va="center", fontsize=7, color="0.25", zorder=2)
        majority = int(tree.majority[node])
        if tree.is_leaf(node):
            words, face = f"{label_text(tree, majority)}\n{tree.weight[node]:.4g}", colours(majority % 20)
        else:
            words, face = tree.attribute(node).name, "white"
        box = {"boxstyle": "round", "facecolor": face, "edgecolor": "0.3", "alpha": 0.95}
        axes.text(x[node], y[node], words, ha="center", va="center", fontsize=8, bbox=box, zorder=3)
    return axes


def _places(tree: Tree) -> tuple[list[float], list[float]]:
    """Leaves from left to right at 0, 1, ..., an inner node between its outer sons, one unit down a level."""
    x, y = np.zeros(tree.n_nodes), np.zeros(tree.n_nodes)
    stack, leaves = [0], 0
    while stack:
        node = stack.pop()
        if tree.is_leaf(node):
            x[node], leaves = leaves, leaves + 1
        stack.extend(reversed(tree.sons(node)))
    for node in range(1, tree.n_nodes):
        y[node] = y[tree.parent[node]] - 1
    for node in reversed(range(tree.n_nodes)):
        if not tree.is_leaf(node):
            sons = tree.sons(node)
            x[node] = (x[sons[0]] + x[sons[-1]]) / 2
    return x.tolist(), y.tolist()
