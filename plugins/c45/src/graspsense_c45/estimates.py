"""The pessimistic estimate of the errors of a leaf: an upper confidence limit of a binomial.

Source: Quinlan, C4.5 (1993), section 4.2; weka.core.Stats and weka.classifiers.trees.j48.Stats 3.9.6 for the end cases.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from graspsense_c45.arithmetic import TOLERANCE, WEIGHT_BITS, bits_below, ln, one_minus_exp, real_weight
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
    return Confidence(ln(factor32), NormalDist().inv_cdf(1.0 - factor32), factor32 <= 0.5)


def prepare_estimation(factor: float, total_weight: float, weight_bits: int) -> Estimation:
    """Return how errors are estimated for a confidence factor and a training weight (in rows)."""
    bits = bits_below(2.0 * total_weight, WEIGHT_BITS)
    # Weights so small that the slack exceeds all integers are within the tolerance of none: there is nothing to prune.
    limit = math.ceil(math.ldexp(PRUNING_SLACK + TOLERANCE, min(bits, 62)))
    return Estimation(prepare_confidence(factor), weight_bits, bits, limit)


def estimate(total: int, errors: int, estimation: Estimation) -> int:
    """Return the estimated errors of a leaf in units of ``2**-bits``, from its fixed-point weight and errors."""
    expected = estimated_errors(
        real_weight(total, estimation.weight_bits),
        real_weight(errors, estimation.weight_bits),
        estimation.confidence,
    )
    return round(math.ldexp(expected, estimation.bits))


def estimated_errors(weight: float, errors: float, confidence: Confidence) -> float:
    """Return the errors to expect of a leaf that made `errors` on the training weight `weight`, both in rows."""
    if weight < TOLERANCE:
        return 0.0
    if not confidence.adds:
        return errors
    z, n, e = confidence.z, weight, max(errors, 0.0)
    # From one error on: Wilson's upper limit with a continuity correction.
    whole = max(e, 1.0)
    if whole + 0.5 >= n:
        added = max(n - whole, 0.0)
    else:
        f = (whole + 0.5) / n
        spread = math.sqrt(max(f / n - f * f / n + z * z / (4.0 * n * n), 0.0))
        added = (f + z * z / (2.0 * n) + z * spread) / (1.0 + z * z / n) * n - whole
    if e < 1.0:
        # Below one error: exact at no error, linear up to one.
        added_none = n * one_minus_exp(confidence.ln_factor / n)
        added = added_none + e * (added - added_none)
    return e + added
