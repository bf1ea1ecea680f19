"""A tree as J48 prints it."""

from __future__ import annotations

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.branch_words import j48_branch, label_text
from graspsense_c45.numbers_as_text import weka_weight
from graspsense_c45.tree import Tree


def to_text(tree: Tree) -> str:
    """Return J48's text below its title: one line per branch, (weight/errors) at leaves, numbers of leaves and nodes.

    With -B J48 prints all digits of a threshold; here thresholds have at most six decimals, as without -B.
    """
    lines = [f": {_leaf(tree, 0, 0)}"] if tree.is_leaf(0) else ["", *_branches(tree)]
    lines += ["", f"Number of Leaves  : \t{tree.n_leaves}", "", f"Size of the tree : \t{tree.node_count}", ""]
    return "\n".join(lines)


def _branches(tree: Tree) -> list[str]:
    lines = []
    stack = [(0, slot, 0) for slot in reversed(range(len(tree.children(0))))]
    while stack:
        node, slot, depth = stack.pop()
        child = tree.children(node)[slot]
        line = "|   " * depth + j48_branch(tree, node, slot)
        if tree.is_leaf(child):
            line += f": {_leaf(tree, child, node)}"
        lines.append(line)
        stack += [(child, below, depth + 1) for below in reversed(range(len(tree.children(child))))]
    return lines


def _leaf(tree: Tree, leaf: int, parent: int) -> str:
    # A branch without training weight has the class of its parent.
    weight = float(tree.weighted_n_node_samples[leaf])
    majority = int(tree.majority_class[leaf if weight > TOLERANCE else parent])
    errors = weight - float(tree.class_weights[leaf, majority])
    wrong = f"/{weka_weight(errors)}" if errors > TOLERANCE else ""
    return f"{label_text(tree, majority)} ({weka_weight(weight)}{wrong})"
