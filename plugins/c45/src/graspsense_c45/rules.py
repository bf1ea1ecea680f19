"""A tree as rules, one per leaf, with support and probability."""

from __future__ import annotations

from attrs import frozen

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.branch_words import branch
from graspsense_c45.tree import Tree


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
    support = float(tree.weighted_n_node_samples[leaf])
    if support < TOLERANCE:
        majority, probability = int(tree.majority_class[max(int(tree.parent[leaf]), 0)]), 0.0
    else:
        majority = int(tree.majority_class[leaf])
        probability = float(tree.class_weights[leaf, majority]) / support
    return Rule(conditions, tree.schema.classes[majority], support, probability)
