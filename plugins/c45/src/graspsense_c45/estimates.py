"""The pessimistic estimate of the errors of a leaf: an upper confidence limit of a binomial.

Source: Quinlan, C4.5 (1993), section 4.2; weka.core.Stats and weka.classifiers.trees.j48.Stats 3.9.6 for the end cases.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from graspsense_c45.arithmetic import (
    TOLERANCE,
    WEIGHT_BITS,
    bits_below,
    ln,
    one_minus_exp,
    real_weight,
    select,
    to_integer,
)
from graspsense_c45.arrays import Elementwise, Real, Whole
from graspsense_c45.criteria import PRUNING_SLACK


class Confidence(NamedTuple):
    """The numbers of a confidence factor: its logarithm, its normal quantile, and whether it adds errors at all."""

    ln_factor: float
    z: float
    adds: bool


class Estimation(NamedTuple):
    """How errors are estimated in fixed point.

    confidence: of the limit. weight_bits: of the given weights. bits: of the estimates, in units of
    ``2**-bits``.
    limit: the least difference of estimates that counts.
    """

    confidence: Confidence
    weight_bits: int
    bits: int
    limit: int


def prepare_confidence(factor: float) -> Confidence:
    """Return the numbers of a confidence factor; J48 keeps it in 32 bits (0.1 is 0.10000000149)."""
    factor32 = float(np.float32(factor))
    return Confidence(float(ln(factor32)), NormalDist().inv_cdf(1.0 - factor32), factor32 <= 0.5)


def prepare_estimation(factor: float, total_weight: float, weight_bits: int) -> Estimation:
    """Return how errors are estimated for a confidence factor and a training weight (in rows)."""
    bits = bits_below(2.0 * total_weight, WEIGHT_BITS)
    # Weights so small that the slack exceeds all integers are within the tolerance of none: there is nothing to prune.
    limit = int(np.ceil(np.ldexp(PRUNING_SLACK + TOLERANCE, min(bits, 62))))
    return Estimation(prepare_confidence(factor), weight_bits, bits, limit)


def estimate(total: Whole, errors: Whole, estimation: Estimation) -> Elementwise:
    """Return the estimated errors of a leaf in units of ``2**-bits``, from its fixed-point weight and errors."""
    expected = estimated_errors(
        real_weight(total, estimation.weight_bits),
        real_weight(errors, estimation.weight_bits),
        estimation.confidence,
    )
    return to_integer(np.rint(np.ldexp(expected, estimation.bits)))


def estimated_errors(weight: Real, errors: Real, confidence: Confidence) -> Real:
    """Return the errors to expect of a leaf that made `errors` on the training weight `weight`, both in rows."""
    if not confidence.adds:
        return select(weight < TOLERANCE, 0.0, errors)
    z = confidence.z
    n = select(weight < TOLERANCE, 1.0, weight)
    e = np.maximum(errors, 0.0)
    # From one error on: Wilson's upper limit with a continuity correction.
    whole = np.maximum(e, 1.0)
    f = (whole + 0.5) / n
    spread = np.sqrt(np.maximum(f / n - f * f / n + z * z / (4.0 * n * n), 0.0))
    limit = (f + z * z / (2.0 * n) + z * spread) / (1.0 + z * z / n) * n - whole
    added_whole = select(whole + 0.5 >= n, np.maximum(n - whole, 0.0), limit)
    # Below one error: exact at no error, linear up to one.
    added_none = n * one_minus_exp(confidence.ln_factor / n)
    added = select(e < 1.0, added_none + e * (added_whole - added_none), added_whole)
    return select(weight < TOLERANCE, 0.0, e + added)
