"""Features brought to one scale, as distances and networks need them: whatever their units, they count as much.

A missing feature is the median of the training trials, 0 where none of them had it. A feature that all training trials
have in common tells nothing of its unit, so that nothing can be learned from another value: it always counts as the
same.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import frozen

from graspsense.core.values.features import LARGEST_VALUE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

MOST_SCALED: Final = 1e30
"""The largest scaled feature: trees compute with 32 bits, distances with squares."""
_ROUNDING: Final = 1e-12
"""A feature that varies by less of its largest value is constant; scaling would amplify rounding to noise."""


@frozen(kw_only=True, eq=False)
class Scaling:
    """What stands for a missing feature, the value that becomes 0, and the difference that becomes 1, of each feature.

    The difference is infinite for a feature that was constant in training.
    """

    fill: Values
    origin: Values
    scale: Values

    def ready(self, values: Values) -> Values:
        """Return these trials filled and scaled. A feature that is too far away counts as the farthest."""
        filled = np.clip(np.where(np.isnan(values), self.fill, values), -LARGEST_VALUE, LARGEST_VALUE)
        with np.errstate(over="ignore"):
            scaled = (filled - self.origin) / self.scale
        return np.clip(scaled, -MOST_SCALED, MOST_SCALED)


def mean_and_deviation(values: Values) -> tuple[Values, Values]:
    """Return the mean and the standard deviation of each feature."""
    return values.mean(axis=0), values.std(axis=0)


def scaling_of(values: Values, origin_and_scale: Callable[[Values], tuple[Values, Values]]) -> Scaling:
    """Return the scaling of training trials, shape (trials, features), by what gives the origin and the scale."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # by numpy, for a column without values
        fill = np.nan_to_num(np.nanmedian(values, axis=0), nan=0.0)
    filled = np.where(np.isnan(values), fill, values)
    # Powers of two, which keep every digit: the square of a value below 1e-162 would be 0.
    units = np.ldexp(1.0, np.frexp(np.abs(filled).max(axis=0))[1] - 1)
    origin, scale = origin_and_scale(filled / units)
    return Scaling(fill=fill, origin=origin * units, scale=np.where(scale > _ROUNDING, scale * units, np.inf))
