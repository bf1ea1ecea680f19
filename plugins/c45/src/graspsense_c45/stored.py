"""A tree as JSON, and back, to the bit."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from graspsense_c45.arrays import NodeColumn, Reals
from graspsense_c45.table import Attribute, Schema
from graspsense_c45.tree import ALL_VALUES, LEAF, Splits, Tree, first_children

FORMAT = "graspsense-c45-tree"
VERSION = 1
_MOST_NODES = 2**31
_ROUNDING = 1e-5


class StoredTreeError(ValueError):
    """A stored tree that cannot be read; the message says what was found and what is allowed."""


def to_document(tree: Tree) -> dict[str, Any]:
    """Return the tree as JSON values: its attributes, its classes, and its nodes in columns, breadth first.

    The columns of the nodes are `feature`, `threshold`, `category` and `n_children` (see `tree.Splits`), and
    `class_weights` (see `tree.Tree`).
    """
    splits = tree.splits
    return {
        "format": FORMAT,
        "version": VERSION,
        "laplace": tree.laplace,
        "attributes": [
            {"name": a.name, "unit": a.unit, "values": None if a.values is None else list(a.values)}
            for a in tree.schema.attributes
        ],
        "classes": list(tree.schema.classes),
        "nodes": {
            "feature": splits.feature.tolist(),
            "threshold": [None if np.isnan(t) else t for t in splits.threshold.tolist()],
            "category": splits.category.tolist(),
            "n_children": splits.n_children.tolist(),
            "class_weights": tree.class_weights.tolist(),
        },
    }


def to_json(tree: Tree) -> str:
    """Return the tree as JSON text; numbers are read back to the bit."""
    return json.dumps(to_document(tree), allow_nan=False)


def from_json(text: str | bytes) -> Tree:
    """Return the tree in a JSON text. Raises StoredTreeError if the text is not a stored tree."""
    try:
        document = json.loads(text)
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StoredTreeError(f"not JSON: {error}") from None
    return from_document(document)


def from_document(document: Any) -> Tree:
    """Return the tree in JSON values. Raises StoredTreeError if they are not a stored tree of this version."""
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise StoredTreeError(f"not a stored tree: 'format' must be {FORMAT!r}")
    if document.get("version") != VERSION:
        raise StoredTreeError(
            f"version {document.get('version')!r} of a stored tree; this release reads {VERSION}"
        )
    try:
        schema = _schema(document)
        nodes = document["nodes"]
        n_nodes = len(_list(nodes["feature"], "nodes.feature"))
        feature, category, n_children = (
            _integers(nodes[key], n_nodes, f"nodes.{key}") for key in ("feature", "category", "n_children")
        )
        threshold = _reals(nodes["threshold"], n_nodes, "nodes.threshold", missing=True)
        rows = _list(nodes["class_weights"], "nodes.class_weights", n_nodes)
        class_weights = np.array(
            [_reals(row, len(schema.classes), "nodes.class_weights") for row in rows], dtype=np.float64
        )
        laplace = document["laplace"]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise StoredTreeError(f"damaged stored tree: {_words(error)}") from None
    if not isinstance(laplace, bool):
        raise StoredTreeError("damaged stored tree: laplace must be true or false")
    if not n_nodes:
        raise StoredTreeError("damaged stored tree: nodes.feature is empty")
    splits = Splits(feature, threshold, category, first_children(n_children), n_children)
    _check(splits, schema, class_weights)
    return Tree(schema, splits, class_weights, laplace)


def _words(error: Exception) -> str:
    return f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)


def _schema(document: dict[str, Any]) -> Schema:
    """Return the attributes and classes. Raises KeyError, TypeError or ValueError."""
    attributes = []
    for k, kept in enumerate(_list(document["attributes"], "attributes")):
        place = f"attributes.{k}"
        name, unit, values = kept["name"], kept["unit"], kept["values"]
        if values is not None:
            values = _distinct(_list(values, f"{place}.values"), f"{place}.values: a value", (str,))
        if not isinstance(name, str) or not isinstance(unit, str):
            raise TypeError(f"{place}: name and unit must be text")
        attributes.append(Attribute(name, unit, values))
    _distinct([attribute.name for attribute in attributes], "attributes: a name", (str,))
    classes = _list(document["classes"], "classes")
    if not classes:
        raise ValueError("classes is empty")
    return Schema(tuple(attributes), _distinct(classes, "classes: a class label", (str, int, float, bool)))


def _distinct(items: Sequence[Any], place: str, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    for item in items:
        if type(item) not in kinds or (isinstance(item, float) and not np.isfinite(item)):
            allowed = " or ".join(kind.__name__ for kind in kinds)
            raise TypeError(f"{place} is {item!r:.40}; it must be {allowed}")
    if len(set(items)) < len(items):
        raise ValueError(f"{place} is there twice")
    return tuple(items)


def _list(items: Any, place: str, length: int | None = None) -> list[Any]:
    if not isinstance(items, list):
        raise TypeError(f"{place} must be a list")
    if length is not None and len(items) != length:
        raise ValueError(f"{place} differ in length: {len(items)} entries, and {length} are needed")
    return items


def _integers(numbers: Any, length: int, place: str) -> NodeColumn:
    for number in _list(numbers, place, length):
        if type(number) is not int or not -1 <= number < _MOST_NODES:
            raise TypeError(f"{place} holds {number!r:.40}; expected integers from -1 on")
    return np.array(numbers, dtype=np.int32)


def _reals(numbers: Any, length: int, place: str, *, missing: bool = False) -> Reals:
    for number in _list(numbers, place, length):
        if type(number) not in (int, float) and not (missing and number is None):
            raise TypeError(f"{place} holds {number!r:.40}; expected numbers")
    array = np.array([np.nan if number is None else number for number in numbers], dtype=np.float64)
    if not np.isfinite(array[[number is not None for number in numbers]]).all():
        raise ValueError(f"{place} must be finite")
    return array


def _check(splits: Splits, schema: Schema, class_weights: Reals) -> None:
    """Raise StoredTreeError unless these are the nodes of a tree with weights that add up."""
    n_nodes = len(splits.feature)
    if (class_weights < 0).any() or not np.isfinite(class_weights.sum()):
        raise StoredTreeError(
            "damaged stored tree: nodes.class_weights must not be negative, with a finite sum"
        )
    children = np.where(splits.n_children > 0, splits.first_child.astype(np.int64), n_nodes)
    upwards = (splits.n_children < 0).any() or (children <= np.arange(n_nodes)).any()
    if splits.n_children.sum() != n_nodes - 1 or upwards:
        raise StoredTreeError("damaged stored tree: the children do not form a tree")
    for node in range(n_nodes):
        _check_node(splits, schema, node)
    _check_sums(splits, class_weights.sum(axis=1))


def _check_sums(splits: Splits, weights: Reals) -> None:
    """Raise StoredTreeError unless each node has the weight of its children together."""
    inner = np.flatnonzero(splits.feature != LEAF)
    parent = np.repeat(inner, splits.n_children[inner])
    below = np.bincount(parent, weights=weights[splits.children(inner)], minlength=len(weights))[inner]
    # Parts of rows with missing values are rounded, and the smallest are left out.
    if not weights[0] > 0 or not (np.abs(below - weights[inner]) <= _ROUNDING * weights[inner]).all():
        raise StoredTreeError(
            "damaged stored tree: nodes.class_weights do not add up from the leaves to the root"
        )
    if (weights[inner] <= 0).any():
        raise StoredTreeError("damaged stored tree: an inner node has no weight in nodes.class_weights")


def _check_node(splits: Splits, schema: Schema, node: int) -> None:
    feature, category = int(splits.feature[node]), int(splits.category[node])
    numeric = not np.isnan(splits.threshold[node])
    n_children = int(splits.n_children[node])
    if feature == LEAF:
        fits = n_children == 0 and not numeric and category == ALL_VALUES
    elif not 0 <= feature < len(schema.attributes):
        fits = False
    else:
        values = schema.attributes[feature].values
        if values is None:
            finite = bool(np.isfinite(splits.threshold[node]))
            fits = finite and n_children == 2 and category == ALL_VALUES
        else:
            fits = (
                not numeric
                and ALL_VALUES <= category < len(values)
                and n_children == (2 if category >= 0 else len(values))
            )
    if not fits:
        raise StoredTreeError(f"damaged stored tree: node {node} does not fit its attribute")
