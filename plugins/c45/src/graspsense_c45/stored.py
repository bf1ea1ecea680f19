"""A tree as JSON, and back, to the bit."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from graspsense_c45.arrays import NodeColumn
from graspsense_c45.schema import Attribute, Schema
from graspsense_c45.splits import ALL_VALUES, LEAF, Splits
from graspsense_c45.tree import Tree, first_children

FORMAT = "graspsense-c45-tree"
VERSION = 1


class StoredTreeError(ValueError):
    """A stored tree that cannot be read; the message says what was found and what is allowed."""


def to_document(tree: Tree) -> dict[str, Any]:
    """Return the tree as JSON values: its attributes, its classes, and its nodes in columns, breadth first.

    The columns of the nodes are `feature`, `threshold`, `category` and `n_children` (see `splits.Splits`), and
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
        attributes = tuple(
            Attribute(
                str(a["name"]), str(a["unit"]), None if a["values"] is None else tuple(map(str, a["values"]))
            )
            for a in document["attributes"]
        )
        classes = tuple(document["classes"])
        nodes = document["nodes"]
        threshold = np.array([np.nan if t is None else t for t in nodes["threshold"]], dtype=np.float64)
        feature, category, n_children = (
            _integers(nodes[key]) for key in ("feature", "category", "n_children")
        )
        class_weights = np.array(nodes["class_weights"], dtype=np.float64)
        laplace = document["laplace"]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise StoredTreeError(f"damaged stored tree: {type(error).__name__}: {error}") from None
    tree = Tree(
        Schema(attributes, classes),
        Splits(feature, threshold, category, first_children(n_children), n_children),
        class_weights,
        laplace is True,
    )
    _check(tree)
    return tree


def _integers(numbers: Any) -> NodeColumn:
    array = np.array(numbers)
    if array.dtype.kind != "i":
        raise TypeError("node numbers must be integers")
    return array.astype(np.int32)


def _check(tree: Tree) -> None:
    splits, n_nodes = tree.splits, len(tree.splits.feature)
    shapes_fit = (
        all(
            column.shape == (n_nodes,)
            for column in (splits.feature, splits.threshold, splits.category, splits.n_children)
        )
        and n_nodes > 0
        and tree.class_weights.shape == (n_nodes, len(tree.schema.classes))
    )
    if not shapes_fit:
        raise StoredTreeError("damaged stored tree: the node columns differ in length, or there is no node")
    if not all(isinstance(label, str | int | float | bool) for label in tree.schema.classes):
        raise StoredTreeError("damaged stored tree: a class label must be a string, a number or a boolean")
    if not np.isfinite(tree.class_weights).all() or (tree.class_weights < 0).any():
        raise StoredTreeError("damaged stored tree: weights must be finite and not negative")
    children = np.where(splits.n_children > 0, splits.first_child.astype(np.int64), n_nodes)
    upwards = (splits.n_children < 0).any() or (children <= np.arange(n_nodes)).any()
    if splits.n_children.sum() != n_nodes - 1 or upwards:
        raise StoredTreeError("damaged stored tree: the children do not form a tree")
    for node in range(n_nodes):
        _check_node(tree, node)


def _check_node(tree: Tree, node: int) -> None:
    splits = tree.splits
    feature, category = int(splits.feature[node]), int(splits.category[node])
    numeric = not np.isnan(splits.threshold[node])
    n_children = int(splits.n_children[node])
    if feature == LEAF:
        fits = n_children == 0 and not numeric and category == ALL_VALUES
    elif not 0 <= feature < len(tree.schema.attributes):
        fits = False
    else:
        values = tree.schema.attributes[feature].values
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
