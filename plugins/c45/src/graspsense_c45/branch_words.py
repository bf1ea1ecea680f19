"""Numbers, and the condition of a branch from a node to one of its children, as text: short, and as Weka prints it."""

from __future__ import annotations

import math
from decimal import ROUND_HALF_EVEN, Decimal

from graspsense_c45.table import Attribute
from graspsense_c45.tree import Tree


def short(value: float, other: float | None = None) -> str:
    """Return three significant digits, or as many as distinguish the value from another one."""
    for digits in range(3, 17):
        text = f"{value:.{digits}g}"
        if other is None or value == other or text != f"{other:.{digits}g}":
            return text
    return repr(value)


def weka_number(value: float) -> str:
    """Return a number as weka.core.Utils.doubleToString with 6 decimals: plain digits, no trailing zeros."""
    exact = Decimal(repr(value))
    if exact.as_tuple().exponent < -6:  # type: ignore[operator]
        exact = exact.quantize(Decimal("0.000001"), ROUND_HALF_EVEN)
    text = f"{exact:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def weka_weight(weight: float) -> str:
    """Return a weight as weka.core.Utils.roundDouble with 2 decimals and Double.toString: one decimal at least."""
    rounded = math.floor(weight * 100.0 + 0.5) / 100.0
    if rounded < 1e7:
        return repr(rounded)
    mantissa, exponent = f"{Decimal(repr(rounded)).normalize():E}".split("E")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}E{int(exponent)}"


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
