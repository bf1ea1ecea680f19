"""What a tree says of rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from graspsense_c45.arithmetic import TOLERANCE, Array
from graspsense_c45.branches import LEAF
from graspsense_c45.descent import CHUNK, reach
from graspsense_c45.engines import choose_fast
from graspsense_c45.options import Engine
from graspsense_c45.table import check_values
from graspsense_c45.tree import Tree, first_maximum


def distributions(tree: Tree, values: ArrayLike, engine: Engine = "auto") -> NDArray[np.float64]:
    """The probability of every class for every row (rows x classes); NaN in ``values`` is missing.

    Raises ValueError: columns that do not fit the tree, infinite values, nominal columns holding no declared index.
    """
    x = _checked(tree, values)
    answers = answers_of_nodes(tree, tree.laplace)
    complete, partial = _by_completeness(x)
    if partial is None:
        return answers[_leaves(tree, x, engine)]
    result = np.empty((len(x), answers.shape[1]))
    result[complete] = answers[_leaves(tree, x[complete], engine)]
    for begin in range(0, len(partial), CHUNK):
        some = partial[begin : begin + CHUNK]
        result[some] = _spread(tree, x[some], answers)
    return result


def class_indices(tree: Tree, values: ArrayLike, engine: Engine = "auto") -> NDArray[np.int64]:
    """The index of the class of every row, as J48 classifies: the first largest unsmoothed probability.

    Raises ValueError as ``distributions`` does.
    """
    x = _checked(tree, values)
    answers = answers_of_nodes(tree, laplace=False)
    complete, partial = _by_completeness(x)
    labels = first_maximum(answers)
    if partial is None:
        return labels[_leaves(tree, x, engine)]
    result = np.empty(len(x), dtype=np.int64)
    result[complete] = labels[_leaves(tree, x[complete], engine)]
    for begin in range(0, len(partial), CHUNK):
        some = partial[begin : begin + CHUNK]
        result[some] = first_maximum(_spread(tree, x[some], answers))
    return result


def answers_of_nodes(tree: Tree, laplace: bool) -> NDArray[np.float64]:
    """The distribution each node would answer with; a leaf that no training weight came to answers as its parent."""
    weights = tree.weights
    n_classes = weights.shape[1]
    if laplace:
        answers = (weights + 1.0) / (tree.weight + n_classes)[:, None]
    else:
        answers = weights / np.where(tree.weight > 0, tree.weight, 1.0)[:, None]
    empty = np.flatnonzero((tree.weight < TOLERANCE) & (tree.parent >= 0))
    answers[empty] = answers[tree.parent[empty]]
    return np.asarray(answers)


def _leaves(tree: Tree, x: Array, engine: Engine) -> NDArray[np.int64]:
    """The leaf of each row; nothing is missing."""
    if choose_fast(engine, x.size) and not any(attribute.is_nominal for attribute in tree.schema.attributes):
        from graspsense_c45 import fast

        return fast.reach(tree.tests, x)
    return reach(tree.tests, x, np.arange(len(x)), np.zeros(len(x), dtype=np.int64))


def _spread(tree: Tree, x: Array, answers: Array) -> NDArray[np.float64]:
    """Distributions of rows with missing values: the sons' answers in proportion to their training weight."""
    tests = tree.tests
    result = np.zeros((len(x), answers.shape[1]))
    rows, nodes, parts = np.arange(len(x)), np.zeros(len(x), dtype=np.int64), np.ones(len(x))
    while rows.size:
        ended = tests.attribute[nodes] == LEAF
        np.add.at(result, rows[ended], parts[ended, None] * answers[nodes[ended]])
        rows, nodes, parts = rows[~ended], nodes[~ended], parts[~ended]
        slots = tests.slot(nodes, x[rows, tests.attribute[nodes]])
        known = slots >= 0
        sons = tests.first_son[nodes[known]] + slots[known]
        missing = nodes[~known]
        each = tests.n_sons[missing]
        all_sons = tests.sons(missing)
        share = tree.weight[all_sons] / np.repeat(tree.weight[missing], each)
        kept = tree.weight[all_sons] >= TOLERANCE
        rows, nodes, parts = (
            np.concatenate((rows[known], np.repeat(rows[~known], each)[kept])),
            np.concatenate((sons, all_sons[kept])),
            np.concatenate((parts[known], (np.repeat(parts[~known], each) * share)[kept])),
        )
    return result


def _by_completeness(x: Array) -> tuple[Array, Array | None]:
    # The minimum of anything with a NaN in it is NaN.
    if not np.isnan(x.min(initial=0.0)):
        return np.arange(0), None
    missing = np.isnan(x).any(axis=1)
    return np.flatnonzero(~missing), np.flatnonzero(missing)


def _checked(tree: Tree, values: ArrayLike) -> NDArray[np.float64]:
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != len(tree.schema.attributes):
        raise ValueError(
            f"values have the shape {x.shape}; the tree takes (rows, {len(tree.schema.attributes)})"
        )
    check_values(tree.schema, x)
    return x
