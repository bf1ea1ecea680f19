"""Columns that vary by so little that J48 sees equal values, such as compliances in m/N or capacities in F.

J48 cuts only between values that differ by more than `GAP`, in whatever unit a column has. In `fit_scaled` a column
that varies by few gaps is multiplied by a power of two, which is exact: the tree is the one in a smaller unit.
"""

from __future__ import annotations

import numpy as np
from attrs import evolve

from graspsense_c45.arrays import Indices
from graspsense_c45.criteria import GAP
from graspsense_c45.fitting import fit
from graspsense_c45.options import Options
from graspsense_c45.splits import LEAF
from graspsense_c45.table import Table
from graspsense_c45.tree import Tree

_GAPS = 100
"""Fewest gaps that the values of a column must span to be used as they are."""
_ROUNDING = 1e-13
"""Variation relative to the largest value that is only rounding, and no measurement."""


def fit_scaled(table: Table, options: Options) -> Tree:
    """Return the tree of a table whose columns that vary by little are scaled."""
    doublings = _doublings(table)
    if not doublings.any():
        return fit(table, options)
    tree = fit(evolve(table, values=np.ldexp(table.values, doublings)), options)
    feature, threshold = tree.splits.feature, tree.splits.threshold.copy()
    inner = np.flatnonzero(feature != LEAF)
    threshold[inner] = np.ldexp(threshold[inner], -doublings[feature[inner]])
    return Tree(tree.schema, evolve(tree.splits, threshold=threshold), tree.class_weights, tree.laplace)


def _doublings(table: Table) -> Indices:
    """Return how often each column is doubled: 0 if it is used as it is."""
    doublings = np.zeros(len(table.schema.attributes), dtype=np.int64)
    for k, attribute in enumerate(table.schema.attributes):
        column = table.values[:, k]
        column = column[~np.isnan(column)]
        if attribute.is_nominal or not column.size:
            continue
        span = float(column.max() - column.min())
        if _ROUNDING * float(np.abs(column).max()) < span < _GAPS * GAP:
            doublings[k] = -int(np.floor(np.log2(span)))
    return doublings
