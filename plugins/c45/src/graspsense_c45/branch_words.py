"""The condition of a branch, from a node to one of its children, as text."""

from __future__ import annotations

from graspsense_c45.numbers_as_text import short, weka_number
from graspsense_c45.schema import Attribute
from graspsense_c45.tree import Tree


def label_text(tree: Tree, class_index: int) -> str:
    """Return a class label as text."""
    return str(tree.schema.classes[class_index])


def with_unit(number: str, attribute: Attribute) -> str:
    """Return a number with the unit of the attribute; the units "" and "1" (a ratio) are left out."""
    return number if attribute.unit in ("", "1") else f"{number} {attribute.unit}"


def j48_branch(tree: Tree, node: int, slot: int) -> str:
    """Return the condition as J48 prints it: ``name <= 1.25``, ``name = value``."""
    return f"{tree.attribute(node).name} {_relation(tree, node, slot)} {_j48_operand(tree, node, slot)}"


def branch(tree: Tree, node: int, slot: int) -> str:
    """Return the condition with its unit: ``name <= 1.25 s``, ``name = value``."""
    attribute = tree.attribute(node)
    if attribute.is_nominal:
        return j48_branch(tree, node, slot)
    threshold = with_unit(short(float(tree.splits.threshold[node])), attribute)
    return f"{attribute.name} {_relation(tree, node, slot)} {threshold}"


def _relation(tree: Tree, node: int, slot: int) -> str:
    if not tree.attribute(node).is_nominal:
        return "<=" if slot == 0 else ">"
    return "!=" if tree.splits.category[node] >= 0 and slot == 1 else "="


def _j48_operand(tree: Tree, node: int, slot: int) -> str:
    values = tree.attribute(node).values
    if values is None:
        return weka_number(float(tree.splits.threshold[node]))
    category = int(tree.splits.category[node])
    return values[category if category >= 0 else slot]
