"""What an engine is given: the rows with a class, weights and x ln x terms in fixed point, the laws' constants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE, Array, bits_below, x_ln_x_array
from graspsense_c45.options import Options
from graspsense_c45.table import MISSING_CLASS, Table

WEIGHT_BITS = 52
"""All weights together stay below 2**52 units, so that a float64 holds every sum of them exactly."""

TERM_BITS = 58
"""All x ln x terms together stay below 2**58 units."""


@dataclass(frozen=True, slots=True)
class Problem:
    """The growing of one tree.

    values, labels: the rows with a class. weights: int64, in units of ``2**-weight_bits``.
    value_counts: declared values of a nominal attribute, 0 for a numeric one.
    averaged: whether an attribute may enter the average gain.
    unit: every weight is one row, exactly. complete: no value is missing.
    """

    values: NDArray[np.float64]
    labels: NDArray[np.int64]
    weights: NDArray[np.int64]
    n_classes: int
    value_counts: NDArray[np.int64]
    averaged: NDArray[np.bool_]
    weight_bits: int
    term_bits: int
    unit: bool
    complete: bool
    options: Options

    def terms(self, weights: Array) -> NDArray[np.int64]:
        """``x ln x`` of fixed-point weights, in units of ``2**-term_bits``."""
        x = np.ldexp(weights.astype(np.float64), -self.weight_bits)
        return np.rint(np.ldexp(x_ln_x_array(x), self.term_bits)).astype(np.int64)

    def real_weights(self, weights: Array) -> NDArray[np.float64]:
        """Fixed-point weights as numbers of rows (exact)."""
        return np.ldexp(weights.astype(np.float64), -self.weight_bits)

    def real_terms(self, terms: Array) -> NDArray[np.float64]:
        """Fixed-point terms as numbers."""
        return np.ldexp(terms.astype(np.float64), -self.term_bits)

    @property
    def weight_margin(self) -> int:
        """A weight is larger than another one when it is so by more than this many units."""
        return int(np.floor(np.ldexp(TOLERANCE, self.weight_bits)))

    def gain_tolerance(self, weight: Array) -> NDArray[np.int64]:
        """The tolerance of a gain, as a difference of numerators at nodes of this weight."""
        return np.asarray(criteria.gain_tolerance(weight, self.term_bits), dtype=np.int64)

    def zero_numerator(self, weight: Array, known_weight: Array) -> NDArray[np.int64]:
        """Below this numerator a gain counts as none."""
        return np.asarray(criteria.least_numerator(weight, known_weight, self.term_bits), dtype=np.int64)

    def units_at_least(self, weight: Array | np.float64) -> NDArray[np.int64]:
        """The least fixed-point weight that counts as ``weight`` or more."""
        return np.asarray(criteria.least_units(weight, self.weight_bits), dtype=np.int64)


def pose(table: Table, rows: NDArray[np.int64] | None, options: Options) -> Problem:
    """The problem of growing a tree on these rows of a table (all, where None); rows without a class are left out."""
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
    largest_term = float(x_ln_x_array(np.array([total]))[0])
    value_counts = np.array(
        [0 if attribute.values is None else len(attribute.values) for attribute in table.schema.attributes],
        dtype=np.int64,
    )
    few = value_counts - criteria.MANY_VALUES * len(table.labels) < -TOLERANCE
    averaged = (value_counts == 0) | few
    if not averaged.any():
        averaged[:] = True
    return Problem(
        values=values,
        labels=labels,
        weights=np.rint(np.ldexp(weights, weight_bits)).astype(np.int64),
        n_classes=len(table.schema.classes),
        value_counts=value_counts,
        averaged=averaged,
        weight_bits=weight_bits,
        term_bits=bits_below(largest_term + 1.0, TERM_BITS),
        unit=unit_weights and complete,
        complete=complete,
        options=options,
    )
