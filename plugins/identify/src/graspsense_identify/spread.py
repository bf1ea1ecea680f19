"""Uncertainty: from squeeze to squeeze and from object to object, by leaving parts out in turn.

The interval is that of the jackknife of the logarithms. The scatter between squeezes is usually many times the standard
deviation that one fit gives itself. No interval is smaller than that of the linearised fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense_identify.corners import corner_errors
from graspsense_identify.fit import Fitted, linear_covariance
from graspsense_identify.interval import NORMAL
from graspsense_identify.parts import LEAST_INSTANCES, Parts

Floats = NDArray[np.float64]

DRAWS: Final = 200
LARGEST: Final = math.log(30.0)
"""A logarithm changes by at most this in proportion to the force. A larger change is one of a value near zero."""
PATH_ERROR: Final = 1e-3
"""Standard deviation of the logarithm of a value that the finite number of nodes of a path causes, at least."""
PATH_FORCE_ERROR: Final = 1e-4
"""The same of the force, over the peak. With both, the intervals from one squeeze with an ideal sensor cover more than
nine of ten (`benchmarks/identify.py --sensors ideal --recordings 1`). No recording of a real sensor is as exact."""


class Components(NamedTuple):
    """The standard deviations of a quantity between objects, and between squeezes of one object."""

    objects: float
    """NaN with fewer than three objects."""
    squeezes: float
    """NaN with a single squeeze of each object."""

    @property
    def of_scene(self) -> float:
        """That of a scene: without numbers of the objects, that between squeezes, whatever it comes from."""
        return self.squeezes if math.isnan(self.objects) else self.objects

    @property
    def whole(self) -> float:
        """That of a squeeze of another object."""
        return float(np.sqrt(np.nansum(np.square(self))))


@frozen(kw_only=True, eq=False)
class Uncertainty:
    """The intervals of the parameters, draws of them, and the spreads between objects and between squeezes."""

    low: tuple[float, ...]
    high: tuple[float, ...]
    basis: str
    draws: Floats
    """(draws, parameters)"""
    stiffness: Components
    """Of its logarithm."""
    width_m: Components


def uncertainty(
    fitted: Fitted, parts: Parts, force_scale: float = 0.0, lag_error_s: float = 0.0
) -> Uncertainty:
    """Return the uncertainty of a fit.

    `force_scale`: standard deviation of the logarithm of the force's scale. `lag_error_s`: that of the lag of the force
    (s), beyond what the squeezes show by their scatter; 0 if the lag was not identified.
    """
    rng = np.random.default_rng(0)
    names = [squeeze.instance for squeeze in fitted.squeezes]
    factor = parts.factor
    scattered = parts.covariance(np.log([part.fitted.values for part in parts.parts]))
    linear = linear_covariance(fitted, PATH_FORCE_ERROR)
    covariance = at_least(scattered, linear * (NORMAL / factor) ** 2)
    # An error of the scale of the force is common to all squeezes, so that none of them shows it.
    scaled = force_scale * np.array([parameter.is_force for parameter in fitted.candidate.free])
    own = np.outer(scaled, scaled) + PATH_ERROR**2 * np.eye(len(fitted.values))
    own += np.diag(corner_errors(fitted) ** 2)
    if lag_error_s > 0.0:
        later = [squeeze.delayed(lag_error_s) for squeeze in fitted.squeezes]
        shift = np.log(evolve(fitted, squeezes=later).refitted().values) - np.log(fitted.values)
        own += np.outer(shift, shift)
    covariance = covariance + own * (NORMAL / factor) ** 2
    spread = np.sqrt(np.diag(covariance))
    best = np.array(fitted.values)
    low, high = best * _changed(-factor * spread), best * _changed(factor * spread)
    # An undetermined direction has a variance beside which the rounding of others may be negative.
    drawn = rng.multivariate_normal(
        np.zeros(len(best)), covariance, DRAWS, check_valid="ignore", method="eigh"
    )
    return Uncertainty(
        low=tuple(low.tolist()),
        high=tuple(high.tolist()),
        basis=parts.basis,
        draws=best * _changed(factor / NORMAL * drawn),
        stiffness=_components(np.log(fitted.factors), names),
        width_m=_components(np.array(fitted.widths_m), names),
    )


def _changed(logs: Floats) -> Floats:
    """Return the factors by which values change for changes of their logarithms by the linearised fit.

    A value near zero hardly changes the force: its linearised change is far more than its own size, and no exponential.
    """
    factors: Floats = np.maximum(np.exp(np.clip(logs, -LARGEST, LARGEST)), 1.0 + logs)
    return factors


def at_least(covariance: Floats, other: Floats) -> Floats:
    """Return the covariance with each variance not smaller than in the other.

    In a flat valley of the squares, a refit stays where it begins and does not scatter, and a few squeezes may agree by
    chance.
    """
    both = covariance + other
    own = np.sqrt(np.maximum(np.diag(covariance), np.diag(other)))
    ratio = own / np.sqrt(np.diag(both))
    return both * np.outer(ratio, ratio)


def _components(values: Floats, names: Sequence[str]) -> Components:
    """Return the standard deviations between and within objects of these names (analysis of variance)."""
    groups = [values[[i for i, own in enumerate(names) if own == name]] for name in sorted(set(names))]
    degrees = sum(len(group) - 1 for group in groups)
    within = math.nan
    if degrees > 0:
        within = math.sqrt(sum(float(np.sum((group - group.mean()) ** 2)) for group in groups) / degrees)
    if len(groups) < LEAST_INSTANCES:
        return Components(math.nan, within)
    means = np.array([group.mean() for group in groups])
    size = len(values) / len(groups)
    inside = 0.0 if math.isnan(within) else within * within / size
    return Components(math.sqrt(max(float(np.var(means, ddof=1)) - inside, 0.0)), within)
