"""The tree as J48 dumps it."""

from __future__ import annotations

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.branch_words import j48_branch, label_text
from graspsense_c45.numbers_as_text import weka_weight
from graspsense_c45.tree import Tree


def to_text(tree: Tree) -> str:
    """J48's dump below its title: a line a branch, leaves with (weight/errors), then how many leaves and nodes.

    (With -B J48 prints thresholds with all their digits; here they have six decimals at most, as without.)
    """
    lines = [f": {_leaf(tree, 0, 0)}"] if tree.is_leaf(0) else ["", *_branches(tree)]
    lines += ["", f"Number of Leaves  : \t{tree.n_leaves}", "", f"Size of the tree : \t{tree.n_nodes}", ""]
    return "\n".join(lines)


def _branches(tree: Tree) -> list[str]:
    lines = []
    stack = [(0, slot, 0) for slot in reversed(range(len(tree.sons(0))))]
    while stack:
        node, slot, depth = stack.pop()
        son = tree.sons(node)[slot]
        line = "|   " * depth + j48_branch(tree, node, slot)
        if tree.is_leaf(son):
            line += f": {_leaf(tree, son, node)}"
        lines.append(line)
        stack += [(son, below, depth + 1) for below in reversed(range(len(tree.sons(son))))]
    return lines


def _leaf(tree: Tree, leaf: int, parent: int) -> str:
    # A branch that no training weight took has its parent's class.
    weight = float(tree.weight[leaf])
    majority = int(tree.majority[leaf if weight > TOLERANCE else parent])
    errors = weight - float(tree.weights[leaf, majority])
    wrong = f"/{weka_weight(errors)}" if errors > TOLERANCE else ""
    return f"{label_text(tree, majority)} ({weka_weight(weight)}{wrong})"
