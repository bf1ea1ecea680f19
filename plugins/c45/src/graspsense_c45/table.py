"""The names of attributes and classes, and the rows that a tree is grown on, checked."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike

from graspsense_c45.arrays import Indices, Reals


@frozen
class Attribute:
    """A column of the table.

    name: its name.
    unit: the unit of a numeric attribute; may be empty.
    values: the declared values of a nominal attribute, in order; None for a numeric one.
    """

    name: str
    unit: str = ""
    values: tuple[str, ...] | None = None

    @property
    def is_nominal(self) -> bool:
        """Whether the attribute has a few declared values instead of numbers."""
        return self.values is not None


@frozen
class Schema:
    """The attributes and the declared classes, both in order; a declared class need not occur.

    A class label is a string, an integer, a float or a boolean, and keeps its type through JSON.
    """

    attributes: tuple[Attribute, ...]
    classes: tuple[str | int | float | bool, ...]


LARGEST_WEIGHT = 1e150
"""The largest sum of the weights: four times its square is still finite."""
MISSING_CLASS = -1
"""The label of a row without a class."""


@frozen(eq=False)
class Table:
    """Rows of attribute values, class indices and weights. Made by `make_table`, which checks them.

    values: rows x attributes, in the unit of the attribute; NaN is missing; a nominal column holds indices of values.
    labels: class indices; -1 is a missing class. The tree does not learn from such a row, but its values are candidates
        for thresholds.
    weights: one per row, finite and not negative.
    """

    schema: Schema
    values: Reals
    labels: Indices
    weights: Reals


def make_table(
    schema: Schema, values: ArrayLike, labels: ArrayLike, weights: ArrayLike | None = None
) -> Table:
    """Return a table; every row has weight 1 by default.

    Raises ValueError for shapes that do not fit, infinite values, nominal columns that hold anything but indices of
    declared values, labels outside the declared classes, weights that are negative, not finite, all 0 or above
    `LARGEST_WEIGHT` together, and where no row has a class.
    """
    x = np.asarray(values, dtype=np.float64)
    y = np.asarray(labels, dtype=np.int64)
    if x.ndim != 2 or x.shape[1] != len(schema.attributes):
        raise ValueError(f"values have the shape {x.shape}; expected (rows, {len(schema.attributes)})")
    if y.shape != (x.shape[0],):
        raise ValueError(f"labels have the shape {y.shape}; expected ({x.shape[0]},), one per row")
    w = np.ones(x.shape[0]) if weights is None else np.asarray(weights, dtype=np.float64)
    if w.shape != y.shape:
        raise ValueError(f"weights have the shape {w.shape}; expected {y.shape}, one per row")
    check_values(schema, x)
    if y.size and (y.min() < MISSING_CLASS or y.max() >= len(schema.classes)):
        raise ValueError(f"labels must be in 0..{len(schema.classes) - 1} or {MISSING_CLASS} (missing class)")
    if not np.all(np.isfinite(w)) or np.any(w < 0):
        raise ValueError("weights must be finite and not negative")
    known = y != MISSING_CLASS
    if not known.any():
        raise ValueError("no row has a class; there is nothing to learn")
    if not w[known].any():
        raise ValueError("all rows with a class have the weight 0; there is nothing to learn")
    if not float(np.abs(w / LARGEST_WEIGHT).sum()) <= 1.0:
        raise ValueError(
            f"the weights add up to more than {LARGEST_WEIGHT:g}; divide them all by the same number"
        )
    return Table(schema, x, y, w)


def check_values(schema: Schema, x: Reals) -> None:
    """Raise ValueError if a value is infinite or not an index of a declared value in a nominal column."""
    # If the sum is finite, so is every value. This usual case takes one pass.
    with np.errstate(over="ignore", invalid="ignore"):
        suspicious = not np.isfinite(x.sum())
    if suspicious and np.isinf(x).any():
        row, column = np.argwhere(np.isinf(x))[0]
        raise ValueError(
            f"infinite value (infinity) in row {row}, column {schema.attributes[column].name}; "
            "values must be finite, NaN where missing"
        )
    for column, attribute in enumerate(schema.attributes):
        if attribute.values is not None:
            codes = x[:, column]
            codes = codes[~np.isnan(codes)]
            if codes.size and not np.all(
                (codes >= 0) & (codes < len(attribute.values)) & (codes == np.floor(codes))
            ):
                raise ValueError(
                    f"nominal column {attribute.name} must hold the indices 0..{len(attribute.values) - 1} "
                    "of its declared values, NaN where missing"
                )
