"""Calibrated probabilities: temperature scaling of what a classifier gives.

Probabilities p become p^(1/T), divided by their sum (C. Guo, G. Pleiss, Y. Sun and K. Q. Weinberger, On calibration of
modern neural networks, ICML 2017, section 4.2). The temperature T gives the smallest Brier score for trials that were
predicted without their instance. (Their likelihood would be decided by the few whose true label got the probability 0,
as trees and nearest neighbours give it.) Above 1 the probabilities move towards each other: the classifier was too
sure, as a tree is whose leaves have few trials. Below 1 they move apart. The order of the labels stays.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEAST: Final = 1e-4
"""Smaller probabilities count as this one."""
RANGE: Final = (0.125, 8.0)
"""The temperatures that are searched."""
MIN_TRIALS: Final = 20
"""With fewer trials, probabilities stay as they are."""


def at_temperature(probabilities: NDArray[np.float64], temperature: float | None) -> NDArray[np.float64]:
    """Return the probabilities, of shape (trials, classes), at this temperature; None returns them as they are.

    NaN marks a label that is not possible, and stays.

    >>> at_temperature(np.array([[0.9, 0.1]]), 2.0).round(2)
    array([[0.75, 0.25]])
    """
    if temperature is None:
        return probabilities
    powers = np.clip(probabilities, LEAST, 1.0) ** (1.0 / temperature)
    calibrated: NDArray[np.float64] = powers / np.nansum(powers, axis=1, keepdims=True)
    return calibrated


def temperature_of(probabilities: NDArray[np.float64], truth: NDArray[np.int64]) -> float | None:
    """Return the temperature of the smallest Brier score; None for fewer than `MIN_TRIALS` trials.

    `probabilities` has shape (trials, classes), `truth` the columns of the true labels.
    """
    from scipy.optimize import minimize_scalar

    if len(truth) < MIN_TRIALS:
        return None
    right = np.eye(probabilities.shape[1])[truth]

    def brier(log_temperature: float) -> float:
        tempered = at_temperature(probabilities, math.exp(log_temperature))
        return float(np.nansum((tempered - right) ** 2, axis=1).mean())

    least, most = RANGE
    optimum: Any = minimize_scalar(brier, bounds=(math.log(least), math.log(most)), method="bounded")
    return math.exp(float(optimum.x))
