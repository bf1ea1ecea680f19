"""A tree as text: as J48 prints it, for Graphviz, and as rules with support and probability."""

from __future__ import annotations

from attrs import frozen

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.branch_words import branch, j48_branch, label_text, weka_weight
from graspsense_c45.tree import Tree


def to_text(tree: Tree) -> str:
    """Return J48's text below its title: one line per branch, (weight/errors) at leaves, numbers of leaves and nodes.

    With -B J48 prints all digits of a threshold; here thresholds have at most six decimals, as without -B.
    """
    lines = [f": {_leaf(tree, 0)}"] if tree.is_leaf(0) else ["", *_branches(tree)]
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
            line += f": {_leaf(tree, child)}"
        lines.append(line)
        stack += [(child, below, depth + 1) for below in reversed(range(len(tree.children(child))))]
    return lines


def _leaf(tree: Tree, leaf: int) -> str:
    weight, majority = float(tree.weighted_n_node_samples[leaf]), int(tree.majority_class[leaf])
    errors = weight - float(tree.class_weights[leaf, majority])
    wrong = f"/{weka_weight(errors)}" if errors > TOLERANCE else ""
    return f"{label_text(tree, majority)} ({weka_weight(weight)}{wrong})"


def to_dot(tree: Tree) -> str:
    """Return the tree in the DOT language: attributes at nodes, conditions at edges, class and weight at leaves."""
    lines = ["digraph c45 {", "  node [shape=box];"]
    for node in range(tree.node_count):
        if tree.is_leaf(node):
            label = (
                f"{label_text(tree, int(tree.majority_class[node]))}\\n{tree.weighted_n_node_samples[node]:g}"
            )
            lines.append(f'  n{node} [label="{_quoted(label)}", style=rounded];')
            continue
        lines.append(f'  n{node} [label="{_quoted(tree.attribute(node).name)}"];')
        for slot, child in enumerate(tree.children(node)):
            words = branch(tree, node, slot).removeprefix(tree.attribute(node).name).strip()
            lines.append(f'  n{node} -> n{child} [label="{_quoted(words)}"];')
    return "\n".join([*lines, "}", ""])


def _quoted(text: str) -> str:
    return text.replace("\\n", "\n").replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


@frozen
class Rule:
    """A leaf as a rule: where all conditions hold, the class is `label`.

    support: the training weight for which they hold, in rows. probability: the fraction of it that has the label, 0
    without support.
    """

    conditions: tuple[str, ...]
    label: str | int | float | bool
    support: float
    probability: float

    def __str__(self) -> str:
        """Return the rule as in ``if a <= 1 and b = x then label (support 12, probability 0.92)``."""
        condition = f"if {' and '.join(self.conditions)} then" if self.conditions else "always"
        return f"{condition} {self.label} (support {self.support:g}, probability {self.probability:.2f})"


def to_rules(tree: Tree) -> tuple[Rule, ...]:
    """Return one rule per leaf, from left to right. Of several bounds on one side, only the tightest is kept."""
    rules = []
    stack: list[tuple[int, dict[tuple[int, str], str]]] = [(0, {})]
    while stack:
        node, conditions = stack.pop()
        if tree.is_leaf(node):
            rules.append(_rule(tree, node, tuple(conditions.values())))
            continue
        for slot in reversed(range(len(tree.children(node)))):
            # A bound further down on the same side is tighter, and replaces the earlier one.
            side = f"{slot}" if not tree.attribute(node).is_nominal else branch(tree, node, slot)
            key = (int(tree.splits.feature[node]), side)
            stack.append((tree.children(node)[slot], conditions | {key: branch(tree, node, slot)}))
    return tuple(rules)


def _rule(tree: Tree, leaf: int, conditions: tuple[str, ...]) -> Rule:
    support, majority = float(tree.weighted_n_node_samples[leaf]), int(tree.majority_class[leaf])
    probability = 0.0 if support < TOLERANCE else float(tree.class_weights[leaf, majority]) / support
    return Rule(conditions, tree.schema.classes[majority], support, probability)
