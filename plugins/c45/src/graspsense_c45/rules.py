"""The tree as rules: one a leaf, with support and probability."""

from __future__ import annotations

from dataclasses import dataclass

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.branch_words import branch
from graspsense_c45.tree import Tree


@dataclass(frozen=True, slots=True)
class Rule:
    """If all conditions hold then the label.

    support: training weight for which they hold; probability: the share of it that has the label (0 without support).
    """

    conditions: tuple[str, ...]
    label: str | int | float | bool
    support: float
    probability: float

    def __str__(self) -> str:
        """``if a <= 1 and b = x then label (support 12, probability 0.92)``."""
        condition = f"if {' and '.join(self.conditions)} then" if self.conditions else "always"
        return f"{condition} {self.label} (support {self.support:g}, probability {self.probability:.2f})"


def to_rules(tree: Tree) -> tuple[Rule, ...]:
    """One rule a leaf, from left to right; of several bounds on one side of an attribute the tightest stays."""
    rules = []
    stack: list[tuple[int, dict[tuple[int, str], str]]] = [(0, {})]
    while stack:
        node, conditions = stack.pop()
        if tree.is_leaf(node):
            rules.append(_rule(tree, node, tuple(conditions.values())))
            continue
        for slot in reversed(range(len(tree.sons(node)))):
            # Further down a bound on the same side is tighter, so it takes the place of the one before.
            side = f"{slot}" if not tree.attribute(node).is_nominal else branch(tree, node, slot)
            key = (int(tree.tests.attribute[node]), side)
            stack.append((tree.sons(node)[slot], conditions | {key: branch(tree, node, slot)}))
    return tuple(rules)


def _rule(tree: Tree, leaf: int, conditions: tuple[str, ...]) -> Rule:
    support = float(tree.weight[leaf])
    if support < TOLERANCE:
        majority, probability = int(tree.majority[max(int(tree.parent[leaf]), 0)]), 0.0
    else:
        majority = int(tree.majority[leaf])
        probability = float(tree.weights[leaf, majority]) / support
    return Rule(conditions, tree.schema.classes[majority], support, probability)
