"""Rows on their way down a tree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from graspsense_c45.arithmetic import Array
from graspsense_c45.branches import LEAF, Tests
from graspsense_c45.rows_of_weight import share

CHUNK = 16_384
"""Rows that go down together: what they need stays in the caches."""


def reach(tree: Tests, values: NDArray[np.float64], rows: Array, nodes: Array) -> NDArray[np.int64]:
    """The leaf that each row comes to from its node; no value that is tested may be missing."""
    flat = np.ascontiguousarray(values).reshape(-1)
    width = values.shape[1]
    nominal = bool(np.isnan(tree.threshold[tree.attribute != LEAF]).any())
    result = nodes.astype(np.int64)
    for begin in range(0, len(rows), CHUNK):
        chunk = slice(begin, begin + CHUNK)
        at: Array = result[chunk].copy()
        offset = rows[chunk] * np.int64(width)
        index = np.arange(len(at))
        while True:
            attribute = tree.attribute[at]
            on_way = attribute != LEAF
            if not on_way.all():
                result[begin + index] = at
                going = np.flatnonzero(on_way)
                if not going.size:
                    break
                at, offset, index, attribute = at[going], offset[going], index[going], attribute[going]
            tested = flat[offset + attribute]
            slots = tree.slot(at, tested) if nominal else tested > tree.threshold[at]
            at = tree.first_son[at] + slots
    return result


def step(
    tree: Tests,
    values: NDArray[np.float64],
    rows: Array,
    weights: Array,
    nodes: Array,
    proportions_of: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Pass weighted rows at inner nodes on to the sons: (rows, weights, sons), those with a missing value in parts.

    Parts are in proportion to ``proportions_of`` (the weight of every node of the tree), or, where that is None, to the
    weight of the rows of this very call that know their value.
    """
    tested = values[rows, tree.attribute[nodes]]
    slots = tree.slot(nodes, tested)
    known = slots >= 0
    sons = tree.first_son[nodes[known]] + slots[known]
    if known.all():
        return rows, weights, sons
    if proportions_of is None:
        proportions_of = np.bincount(sons, weights=weights[known], minlength=len(tree.attribute))
    missing = np.flatnonzero(~known)
    part_of, part_son, part_weight = share(
        nodes[missing], weights[missing], tree.first_son, tree.n_sons, proportions_of
    )
    return (
        np.concatenate((rows[known], rows[missing][part_of])),
        np.concatenate((weights[known], part_weight)),
        np.concatenate((sons, part_son)),
    )
