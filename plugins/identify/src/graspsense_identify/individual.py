"""Fits of the chosen law to each squeeze by itself, and whether its values vary from squeeze to squeeze.

Common values that do not hold for all objects fit badly, and a lag may mimic that. So where the values vary, no lag is
taken from the squeezes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense_identify.choose import Choice
from graspsense_identify.delay import EVIDENCE, Lag, lag_beyond_settings
from graspsense_identify.fit import Fitted, information
from graspsense_identify.spread import has_objects
from graspsense_identify.threads import in_threads

Floats = NDArray[np.float64]


def alone(fitted: Fitted) -> list[Fitted]:
    """Return the fits of a candidate to each squeeze by itself; none with fewer than three objects with names."""
    if not has_objects(fitted.squeezes):
        return []
    return in_threads(lambda i: fitted.part([i]).refitted(), range(len(fitted.squeezes)))


def with_own_values(choice: Choice) -> Choice:
    """Return the choice with the fits to each squeeze, and whether the values vary."""
    own = alone(choice.fitted)
    varies = bool(own) and _evidence(own) <= _common_evidence(choice.fitted) - EVIDENCE
    return evolve(choice, alone=own, varies=varies)


def lag_of(choice: Choice) -> Lag:
    """Return the lag of the force beyond the settings."""
    return Lag() if choice.varies else lag_beyond_settings(choice.refined)


def of_each(choice: Choice) -> Fitted:
    """Return the chosen fit with the width of each squeeze, and its factor on the stiffness: where the values vary,
    those that it has by itself."""
    fitted = choice.fitted
    if not choice.varies:
        return fitted
    values = np.log([fitted.values for fitted in choice.alone])
    reference = reference_stiffness(fitted, values)
    logs = np.log(fitted.factors) if reference is None else values[:, reference]
    return evolve(
        fitted,
        widths_m=tuple(fitted.widths_m[0] for fitted in choice.alone),
        factors=tuple(np.exp(logs - logs.mean()).tolist()),
    )


def _evidence(fits: Sequence[Fitted]) -> float:
    """Return half of the Bayesian information criterion of fits to each squeeze, less a constant."""
    residuals = np.concatenate([fitted.residuals for fitted in fits])
    free = sum(len(fitted.values) for fitted in fits)
    return information(float(np.sqrt(np.mean(residuals**2))), free, len(residuals))


def _common_evidence(fitted: Fitted) -> float:
    """Return that of a fit with common values, and a factor of each squeeze on the stiffness."""
    return information(fitted.rms, len(fitted.values) + len(fitted.factors) - 1, len(fitted.residuals))


def stiffnesses(fitted: Fitted) -> list[int]:
    """Return the places of the stiffnesses among the free parameters."""
    return [i for i, parameter in enumerate(fitted.candidate.free) if parameter.is_stiffness]


def reference_stiffness(fitted: Fitted, values: Floats) -> int | None:
    """Return the stiffness that differs least between the squeezes: the others vary with it, and beyond it."""
    return min(stiffnesses(fitted), key=lambda i: float(np.var(values[:, i])), default=None)
