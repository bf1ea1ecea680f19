"""The pessimistic estimate of a leaf's errors: an upper confidence limit of a binomial.

Source: Quinlan, C4.5 (1993), section 4.2; weka.core.Stats / weka.classifiers.trees.j48.Stats 3.9.6 for the end cases.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from graspsense_c45.arithmetic import TOLERANCE, ln, one_minus_exp, select


class Confidence(NamedTuple):
    """A confidence factor, prepared: its logarithm, its normal quantile, and whether it adds errors at all."""

    ln_factor: float
    z: float
    adds: bool


def prepare_confidence(factor: float) -> Confidence:
    """The numbers the estimate needs; J48 keeps the factor in 32 bits (0.1 is 0.10000000149)."""
    factor32 = float(np.float32(factor))
    return Confidence(ln(factor32), NormalDist().inv_cdf(1.0 - factor32), factor32 <= 0.5)


def estimated_errors(weight: Any, errors: Any, ln_factor: float, z: float, adds: bool) -> Any:
    """Errors to be expected of a leaf that made ``errors`` on the training weight ``weight`` (elementwise)."""
    if not adds:
        return select(weight < TOLERANCE, 0.0, errors)
    n = select(weight < TOLERANCE, 1.0, weight)
    e = np.maximum(errors, 0.0)
    # From one error on: Wilson's upper limit with a continuity correction.
    whole = np.maximum(e, 1.0)
    f = (whole + 0.5) / n
    spread = np.sqrt(np.maximum(f / n - f * f / n + z * z / (4.0 * n * n), 0.0))
    limit = (f + z * z / (2.0 * n) + z * spread) / (1.0 + z * z / n) * n - whole
    added_whole = select(whole + 0.5 >= n, np.maximum(n - whole, 0.0), limit)
    # Below one error: exact at none, linear to one.
    added_none = n * one_minus_exp(ln_factor / n)
    added = select(e < 1.0, added_none + e * (added_whole - added_none), added_whole)
    return select(weight < TOLERANCE, 0.0, e + added)
