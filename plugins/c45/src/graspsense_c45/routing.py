"""Rows on their way from a node to the leaves below it."""

from __future__ import annotations

import numpy as np

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import AnyArray, Indices, Reals
from graspsense_c45.splits import LEAF, Splits, ranges

CHUNK = 16_384
"""Rows that are routed together: their arrays fit into the processor's caches."""


def leaves_of_rows(splits: Splits, values: Reals, rows: Indices, nodes: Indices) -> Indices:
    """Return the leaf that each row comes to from its node.

    values: rows x attributes. No value that is tested may be missing. `depthfirst.compiled.leaves_of_rows` returns the
    same from the root; `tests/test_engines.py` compares the two.
    """
    flat = np.ascontiguousarray(values).reshape(-1)
    width = values.shape[1]
    nominal = bool(np.isnan(splits.threshold[splits.feature != LEAF]).any())
    result = nodes.astype(np.int64)
    for begin in range(0, len(rows), CHUNK):
        chunk = slice(begin, begin + CHUNK)
        node: AnyArray = result[chunk].copy()
        offset = rows[chunk] * np.int64(width)
        index = np.arange(len(node))
        while True:
            feature = splits.feature[node]
            on_way = feature != LEAF
            if not on_way.all():
                result[begin + index] = node
                going = np.flatnonzero(on_way)
                if not going.size:
                    break
                node, offset, index, feature = node[going], offset[going], index[going], feature[going]
            tested = flat[offset + feature]
            slots = splits.slot(node, tested) if nominal else tested > splits.threshold[node]
            node = splits.first_child[node] + slots
    return result


def to_children(
    splits: Splits,
    values: Reals,
    rows: Indices,
    weights: AnyArray,
    nodes: Indices,
    node_weights: AnyArray | None = None,
) -> tuple[Indices, AnyArray, Indices]:
    """Return the rows, weights and children that weighted rows at inner nodes come to.

    A row whose tested value is missing goes to all children, in parts: in proportion to `node_weights`, the weight of
    each node of the tree, or by default to the weight of the given rows that know their value.
    """
    tested = values[rows, splits.feature[nodes]]
    slots = splits.slot(nodes, tested)
    known = slots >= 0
    children = splits.first_child[nodes[known]] + slots[known]
    if known.all():
        return rows, weights, children
    if node_weights is None:
        node_weights = np.bincount(children, weights=weights[known], minlength=len(splits.feature))
    missing = np.flatnonzero(~known)
    part_of, part_child, part_weight = distribute(
        nodes[missing], weights[missing], splits.first_child, splits.n_children, node_weights
    )
    return (
        np.concatenate((rows[known], rows[missing][part_of])),
        np.concatenate((weights[known], part_weight)),
        np.concatenate((children, part_child)),
    )


def distribute(
    nodes: Indices, weights: AnyArray, first_child: AnyArray, n_children: AnyArray, known_weight: AnyArray
) -> tuple[Indices, Indices, Indices]:
    """Distribute rows at `nodes` over the children, in proportion to the known weight of these.

    first_child, n_children: indexed by node. known_weight: indexed by child; where it is 0 for all children of a node
    the parts are equal. Returns for each part the index of its row, its child and its fixed-point weight. A child
    whose proportion is within the tolerance of 0 gets no part.
    """
    each = n_children[nodes]
    row = np.repeat(np.arange(len(nodes)), each)
    child = ranges(first_child[nodes], each)
    total = np.bincount(row, weights=known_weight[child], minlength=len(nodes))
    evenly = 1.0 / np.maximum(each, 1)[row]
    proportion = np.where(total[row] > 0, known_weight[child] / np.where(total > 0, total, 1.0)[row], evenly)
    kept = proportion > TOLERANCE
    return row[kept], child[kept], np.rint(weights[row[kept]] * proportion[kept]).astype(np.int64)
