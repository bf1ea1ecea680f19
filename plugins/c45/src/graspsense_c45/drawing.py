"""A tree drawn with matplotlib (needs the extra ``plot``)."""

from __future__ import annotations

from typing import Any

import numpy as np

from graspsense_c45.branch_words import branch, label_text
from graspsense_c45.tree import Tree


def draw(tree: Tree, axes: Any = None) -> Any:
    """Draw the tree into matplotlib axes, new ones by default, and return them. The root is on top."""
    import matplotlib.pyplot as plt

    x, y = _positions(tree)
    if axes is None:
        size = (max(4.0, 1.3 * tree.n_leaves), max(2.5, 1.1 * (tree.max_depth + 1)))
        axes = plt.figure(figsize=size, layout="constrained").add_subplot()
    axes.set_axis_off()
    axes.set_xlim(-0.6, tree.n_leaves - 0.4)
    axes.set_ylim(-tree.max_depth - 0.4, 0.4)
    colours: Any = plt.get_cmap("tab20")
    for node in range(tree.node_count):
        for slot, child in enumerate(tree.children(node)):
            axes.plot([x[node], x[child]], [y[node], y[child]], color="0.6", linewidth=1, zorder=1)
            words = branch(tree, node, slot).removeprefix(tree.attribute(node).name).strip()
            middle = (x[node] + x[child]) / 2, (y[node] + y[child]) / 2
            axes.text(
                *middle, words, ha="center", va="center", fontsize=7, color="0.25", zorder=2, parse_math=False
            )
        majority = int(tree.majority_class[node])
        if tree.is_leaf(node):
            words, face = (
                f"{label_text(tree, majority)}\n{tree.weighted_n_node_samples[node]:.4g}",
                colours(majority % 20),
            )
        else:
            words, face = tree.attribute(node).name, "white"
        box = {"boxstyle": "round", "facecolor": face, "edgecolor": "0.3", "alpha": 0.95}
        axes.text(
            x[node],
            y[node],
            words,
            ha="center",
            va="center",
            fontsize=8,
            bbox=box,
            zorder=3,
            parse_math=False,
        )
    return axes


def _positions(tree: Tree) -> tuple[list[float], list[float]]:
    """Return x and y of each node: leaves at x = 0, 1, ..., inner nodes midway above their children, y = -depth."""
    x, y = np.zeros(tree.node_count), np.zeros(tree.node_count)
    stack, leaves = [0], 0
    while stack:
        node = stack.pop()
        if tree.is_leaf(node):
            x[node], leaves = leaves, leaves + 1
        stack.extend(reversed(tree.children(node)))
    for node in range(1, tree.node_count):
        y[node] = y[tree.parent[node]] - 1
    for node in reversed(range(tree.node_count)):
        if not tree.is_leaf(node):
            children = tree.children(node)
            x[node] = (x[children[0]] + x[children[-1]]) / 2
    return x.tolist(), y.tolist()
