"""The leaves that rows come to, for compiled code only: in the interpreter numpy is faster."""

from __future__ import annotations

from graspsense_c45.arrays import Indices, NodeColumn, Reals
from graspsense_c45.splits import LEAF


def find_leaves(
    feature: NodeColumn, threshold: Reals, first_child: NodeColumn, values: Reals, leaves: Indices
) -> None:
    """Write the leaf that each row comes to from the root; numeric tests only, no tested value missing.

    `routing.leaves_of_rows` returns the same; `tests/test_engines.py` compares the two.
    """
    for row in range(len(values)):
        node = 0
        while feature[node] != LEAF:
            node = first_child[node] + (values[row, feature[node]] > threshold[node])
        leaves[row] = node
