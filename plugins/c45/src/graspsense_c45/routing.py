"""Rows on their way from a node to the leaves below it."""

from __future__ import annotations

import numpy as np

from graspsense_c45.arrays import AnyArray, Indices, Reals
from graspsense_c45.splits import LEAF, Splits

CHUNK = 16_384
"""Rows that are routed together: their arrays fit into the processor's caches."""


def leaves_of_rows(splits: Splits, values: Reals, rows: Indices, nodes: Indices) -> Indices:
    """Return the leaf that each row comes to from its node.

    values: rows x attributes. No value that is tested may be missing. `building.compiled.leaves_of_rows` returns the
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
