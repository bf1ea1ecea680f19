"""A tree as JSON, and back, to the bit."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspsense_c45.branches import ALL_VALUES, LEAF, Tests
from graspsense_c45.schema import Attribute, Schema
from graspsense_c45.tree import Tree

FORMAT = "graspsense-c45-tree"
VERSION = 1


class StoredTreeError(ValueError):
    """A stored tree that cannot be read; the message says what was found and what is allowed."""


def to_document(tree: Tree) -> dict[str, Any]:
    """The tree as JSON values; the nodes breadth first, the sons of a node one after the other."""
    tests = tree.tests
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
            "attribute": tests.attribute.tolist(),
            "threshold": [None if np.isnan(t) else t for t in tests.threshold.tolist()],
            "value": tests.value.tolist(),
            "n_sons": tests.n_sons.tolist(),
            "weights": tree.weights.tolist(),
        },
    }


def to_json(tree: Tree) -> str:
    """The tree as a JSON text; numbers are written so that they read back to the bit."""
    return json.dumps(to_document(tree), allow_nan=False)


def from_json(text: str | bytes) -> Tree:
    """The tree in a JSON text. Raises StoredTreeError where it is none."""
    try:
        document = json.loads(text)
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StoredTreeError(f"not JSON: {error}") from None
    return from_document(document)


def from_document(document: Any) -> Tree:
    """The tree in JSON values. Raises StoredTreeError where it is none, or of another version."""
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
        attribute, value, n_sons = (_integers(nodes[key]) for key in ("attribute", "value", "n_sons"))
        weights = np.array(nodes["weights"], dtype=np.float64)
        laplace = document["laplace"]
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise StoredTreeError(f"damaged stored tree: {type(error).__name__}: {error}") from None
    first_son = np.where(n_sons > 0, 1 + np.cumsum(n_sons) - n_sons, 0).astype(np.int32)
    tree = Tree(
        Schema(attributes, classes),
        Tests(attribute, threshold, value, first_son, n_sons),
        weights,
        laplace is True,
    )
    _check(tree)
    return tree


def _integers(numbers: Any) -> NDArray[np.int32]:
    array = np.array(numbers)
    if array.dtype.kind != "i":
        raise TypeError("node numbers must be integers")
    return array.astype(np.int32)


def _check(tree: Tree) -> None:
    tests, n_nodes = tree.tests, len(tree.tests.attribute)
    shapes_fit = (
        all(
            column.shape == (n_nodes,)
            for column in (tests.attribute, tests.threshold, tests.value, tests.n_sons)
        )
        and n_nodes > 0
        and tree.weights.shape == (n_nodes, len(tree.schema.classes))
    )
    if not shapes_fit:
        raise StoredTreeError("damaged stored tree: the node columns differ in length, or there is no node")
    if not all(isinstance(label, str | int | float | bool) for label in tree.schema.classes):
        raise StoredTreeError("damaged stored tree: a class label must be a string, a number or a boolean")
    if not np.isfinite(tree.weights).all() or (tree.weights < 0).any():
        raise StoredTreeError("damaged stored tree: weights must be finite and not negative")
    sons = np.where(tests.n_sons > 0, tests.first_son.astype(np.int64), n_nodes)
    if tests.n_sons.sum() != n_nodes - 1 or (tests.n_sons < 0).any() or (sons <= np.arange(n_nodes)).any():
        raise StoredTreeError("damaged stored tree: the sons do not make up a tree")
    for node in range(n_nodes):
        _check_node(tree, node)


def _check_node(tree: Tree, node: int) -> None:
    tests = tree.tests
    attribute, value = int(tests.attribute[node]), int(tests.value[node])
    numeric = not np.isnan(tests.threshold[node])
    n_sons = int(tests.n_sons[node])
    if attribute == LEAF:
        fits = n_sons == 0 and not numeric and value == ALL_VALUES
    elif not 0 <= attribute < len(tree.schema.attributes):
        fits = False
    else:
        values = tree.schema.attributes[attribute].values
        if values is None:
            fits = bool(np.isfinite(tests.threshold[node])) and n_sons == 2 and value == ALL_VALUES
        else:
            fits = (
                not numeric
                and ALL_VALUES <= value < len(values)
                and n_sons == (2 if value >= 0 else len(values))
            )
    if not fits:
        raise StoredTreeError(f"damaged stored tree: node {node} does not fit its attribute")
