"""The rows that a tree is grown on, in fixed point."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from attrs import frozen

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import (
    TERM_BITS,
    TOLERANCE,
    WEIGHT_BITS,
    Scale,
    bits_below,
    real_weight,
    x_ln_x,
)
from graspsense_c45.arrays import FixedPoint, Indices, Mask, Reals, SmallLabels
from graspsense_c45.options import Options
from graspsense_c45.table import MISSING_CLASS, Table


@frozen(eq=False, slots=False)
class TrainingSet:
    """The rows with a class, and the constants that follow from them.

    values: rows x attributes; NaN is missing. labels: the class of each row. weights: in units of ``2**-weight_bits``.
    n_classes: declared classes. value_counts: declared values of a nominal attribute, 0 for a numeric one.
    averaged: whether an attribute enters the average gain.
    scale: the units of weights and terms. unit: whether every row weighs 1 and no value is missing.
    complete: whether no value is missing.
    """

    values: Reals
    labels: Indices
    weights: FixedPoint
    n_classes: int
    value_counts: Indices
    averaged: Mask
    scale: Scale
    unit: bool
    complete: bool
    options: Options

    @property
    def slim(self) -> bool:
        """Whether all attributes are numeric and no value is missing, so that compiled code may be shorter."""
        return self.complete and not self.value_counts.any()

    @property
    def total_weight(self) -> float:
        """The weight of all rows, in rows."""
        return real_weight(int(self.weights.sum()), self.scale.weight_bits)

    @cached_property
    def weight_margin(self) -> int:
        """The largest difference of two fixed-point weights that are equal within the tolerance."""
        # All weights together are below 2**WEIGHT_BITS.
        margin = int(np.floor(np.ldexp(TOLERANCE, min(self.scale.weight_bits, 80))))
        return min(margin, 1 << WEIGHT_BITS)

    @property
    def collapse_slack(self) -> float:
        """The training errors that a subtree may save without being kept, in fixed-point weight."""
        return float(np.ldexp(criteria.COLLAPSE_SLACK, min(self.scale.weight_bits, 80)))

    def small_labels(self) -> SmallLabels:
        """Return the labels in the smallest type that holds them."""
        return self.labels.astype(np.min_scalar_type(self.n_classes))


def make_training_set(table: Table, rows: Indices | None, options: Options) -> TrainingSet:
    """Return these rows of a table (all by default) for growing a tree; rows without a class are left out."""
    chosen = table.labels != MISSING_CLASS
    if rows is not None:
        mask = np.zeros(chosen.shape, dtype=bool)
        mask[rows] = True
        chosen &= mask
    whole = bool(chosen.all())
    values = table.values if whole else table.values[chosen]
    labels = table.labels if whole else table.labels[chosen]
    weights = table.weights if whole else table.weights[chosen]
    unit_weights = bool(np.all(weights == 1.0))
    complete = not bool(np.isnan(values).any())
    total = float(weights.sum())
    whole_numbers = total < 2.0**WEIGHT_BITS and (unit_weights or bool(np.all(weights == np.floor(weights))))
    weight_bits = 0 if complete and whole_numbers else bits_below(total, WEIGHT_BITS)
    value_counts = np.array(
        [0 if attribute.values is None else len(attribute.values) for attribute in table.schema.attributes],
        dtype=np.int64,
    )
    scale = Scale(weight_bits, bits_below(x_ln_x(total) + 1.0, TERM_BITS))
    return TrainingSet(
        values=values,
        labels=labels,
        weights=np.rint(np.ldexp(weights, weight_bits)).astype(np.int64),
        n_classes=len(table.schema.classes),
        value_counts=value_counts,
        averaged=_averaged(value_counts, len(table.labels)),
        scale=scale,
        unit=unit_weights and complete,
        complete=complete,
        options=options,
    )


def _averaged(value_counts: Indices, n_rows: int) -> Mask:
    """Return which attributes enter the average gain.

    Nominal attributes with many values do not, unless no other attribute is left.
    """
    few = value_counts - criteria.MANY_VALUES * n_rows < -TOLERANCE
    averaged: Mask = (value_counts == 0) | few
    if not averaged.any():
        averaged[:] = True
    return averaged
