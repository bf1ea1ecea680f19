"""A branch in words: what leads from a node to one of its sons."""

from __future__ import annotations

from graspsense_c45.numbers_as_text import short, weka_number
from graspsense_c45.schema import Attribute
from graspsense_c45.tree import Tree


def label_text(tree: Tree, class_index: int) -> str:
    """The class label as text."""
    return str(tree.schema.classes[class_index])


def with_unit(number: str, attribute: Attribute) -> str:
    """A number and its unit, where there is one; 1 is that of a ratio."""
    return number if attribute.unit in ("", "1") else f"{number} {attribute.unit}"


def j48_branch(tree: Tree, node: int, slot: int) -> str:
    """As J48 prints it: ``name <= 1.25``, ``name = value``."""
    return f"{tree.attribute(node).name} {_relation(tree, node, slot)} {_j48_operand(tree, node, slot)}"


def branch(tree: Tree, node: int, slot: int) -> str:
    """With unit: ``name <= 1.25 s``, ``name = value``."""
    attribute = tree.attribute(node)
    if attribute.is_nominal:
        return j48_branch(tree, node, slot)
    threshold = with_unit(short(float(tree.tests.threshold[node])), attribute)
    return f"{attribute.name} {_relation(tree, node, slot)} {threshold}"


def _relation(tree: Tree, node: int, slot: int) -> str:
    if not tree.attribute(node).is_nominal:
        return "<=" if slot == 0 else ">"
    return "!=" if tree.tests.value[node] >= 0 and slot == 1 else "="


def _j48_operand(tree: Tree, node: int, slot: int) -> str:
    values = tree.attribute(node).values
    if values is None:
        return weka_number(float(tree.tests.threshold[node]))
    one = int(tree.tests.value[node])
    return values[one if one >= 0 else slot]
