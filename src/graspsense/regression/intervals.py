"""Prediction intervals of numbers, from held-out errors of predictions that are as large (Mondrian conformal).

An interval of one width for all predictions holds on average and not where errors grow with the number, as those of a
mass do. So the held-out trials are divided into bands by their prediction, each with enough units, and a prediction has
the width of its band (H. Boström and U. Johansson, Proc. Mach. Learn. Res. 128 (2020) 24).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.core.learn.conformal import COVERAGE, calibrated_threshold, reach_of, units_needed
from graspsense.core.learn.stored_values import StoredValues

BAND_UNITS: Final = 10
"""Least number of units in a band, if there are as many."""
BAND_SHARE: Final = 0.1
"""Least share of all units in a band: more units give more exact widths, and not more of them."""


@frozen(kw_only=True)
class PredictionIntervals:
    """Half the width of the 90 % interval in each band of predictions.

    `begins` has the least prediction of each band but the first, rising. They hold for trials that are outside of the
    training trials by no more than `reach` (`core.learn.novelty`). Without a width there are no intervals; `reason`
    then says why.
    """

    begins: tuple[float, ...] = ()
    half_widths: tuple[float, ...] = ()
    reason: str = ""
    reach: float = math.inf

    def to_json(self) -> dict[str, Any]:
        """Return the intervals as values that JSON represents exactly."""
        return {
            "coverage": COVERAGE,
            "begins": list(self.begins),
            "half_widths": list(self.half_widths),
            "reason": self.reason,
            **({"reach": self.reach} if math.isfinite(self.reach) else {}),
        }

    def half_width(self, predicted: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return half the width of the interval of each prediction; NaN without intervals."""
        if not self.half_widths:
            return np.full(len(predicted), np.nan)
        bands = np.searchsorted(np.array(self.begins), predicted, side="right")
        return np.asarray(np.array(self.half_widths)[bands])


def intervals_of(
    predicted: NDArray[np.float64],
    errors: NDArray[np.float64],
    instances: Sequence[str] | None,
    outside: NDArray[np.float64] | None = None,
) -> PredictionIntervals:
    """Return the intervals that held-out predictions and their errors calibrate.

    `outside` is how far each trial is outside of those that its prediction was learned from, None if that is not known.
    The unit of exchangeability is the instance, as in the prediction sets of labels (`core.learn.conformal`).
    """
    unit = "trials" if instances is None else "instances"
    units = np.array([str(i) for i in range(len(errors))] if instances is None else instances)
    count, needed = len(np.unique(units)), units_needed(COVERAGE)
    if count < needed:
        return PredictionIntervals(
            reason=f"{count} calibration {unit}, {100 * COVERAGE:.0f} % needs {needed}"
        )
    begins = _begins(predicted, units, max(BAND_UNITS, BAND_SHARE * count))
    bands = np.searchsorted(np.array(begins), predicted, side="right")
    widths = [
        -calibrated_threshold(-np.abs(errors[rows]), units[rows], COVERAGE)
        for rows in (bands == band for band in range(len(begins) + 1))
    ]
    reach = math.inf if outside is None else reach_of(outside, units)
    return PredictionIntervals(begins=begins, half_widths=tuple(widths), reach=reach)


def intervals_from(kept: StoredValues) -> PredictionIntervals:
    """Return the intervals of a stored model. Raises DataDamaged if the bands do not fit the widths."""
    widths = kept.numbers("half_widths", (None,), least=0.0)
    begins = kept.numbers("begins", (max(len(widths) - 1, 0),))
    if (np.diff(begins) <= 0.0).any():
        raise kept.refusal("begins", "the bands do not rise")
    if bool(len(widths)) == bool(kept.text("reason")):
        raise kept.refusal("half_widths", "there are intervals or a reason for none, not both")
    return PredictionIntervals(
        begins=tuple(begins.tolist()),
        half_widths=tuple(widths.tolist()),
        reason=kept.text("reason"),
        reach=kept.number("reach", least=0.0) if "reach" in kept else math.inf,
    )


def _begins(predicted: NDArray[np.float64], units: NDArray[np.str_], least: float) -> tuple[float, ...]:
    """Return where the bands begin after the first, so that each has enough units."""
    begins: list[float] = []
    low = -np.inf
    for value in np.unique(predicted).tolist():
        below = units[(predicted >= low) & (predicted < value)]
        if min(len(np.unique(below)), len(np.unique(units[predicted >= value]))) >= least:
            begins.append(value)
            low = value
    return tuple(begins)
