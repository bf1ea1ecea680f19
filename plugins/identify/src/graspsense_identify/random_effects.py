"""Spreads of single parameters: which of them differ between objects by more than their fits leave open.

Each squeeze is fitted alone. The logarithm of a parameter is that of its object, plus a difference of this squeeze,
plus an error of the fit whose variance the linearised fit gives (random effects). A variance between objects is claimed
where Cochran's Q is improbable without one. Its estimate is that of Paule and Mandel (J. Res. Natl. Bur. Stand. 87,
1982): Q is its expectation. The interval holds the variances at which Q is not improbable (Viechtbauer, Statistics in
Medicine 26, 2007).

All stiffnesses of an object vary together by the `stiffness_spread` of a scene. A stiffness has a spread of its own
where its ratio to the one that differs least varies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense.simulator_api import IdentifiedParameter
from graspsense_identify.corners import corner_errors
from graspsense_identify.fit import Fitted, linear_covariance
from graspsense_identify.individual import reference_stiffness, stiffnesses
from graspsense_identify.interval import LEVEL, identified
from graspsense_identify.spread import LEAST_INSTANCES
from graspsense_sim_gripper.run.identification import MOST_SPREAD

Floats = NDArray[np.float64]

FALSE_CLAIMS: Final = 0.05
"""In how many identifications a spread may be claimed that is not there, of whichever parameter."""
LEAST_ERROR_ALONE: Final = 1e-3
LEAST_FORCE_ERROR_ALONE: Final = 1e-4
"""Errors of a fit to one squeeze, as standard deviations of the logarithm of a value and of the force over the peak.
They are larger than those of `spread`, so that no spread of a thousandth is claimed."""
LARGEST_ERROR: Final = 0.5
"""Standard deviation of a logarithm from which on a fit to one squeeze does not count."""
LARGEST_VARIANCE: Final = 100.0
"""Between objects, of a logarithm: the end of the search."""


class Scatter(NamedTuple):
    """A standard deviation between objects, and the ends of its interval."""

    value: float
    low: float
    high: float


def between(values: Floats, variances: Floats, level: float) -> Scatter | None:
    """Return the scatter beyond the errors of these values; None if errors of these variances make it by themselves.

    `level`: the probability of a claim where there is none.
    """
    from scipy.stats import chi2

    degrees = len(values) - 1
    if _q(values, variances, 0.0) <= float(chi2.ppf(1.0 - level, degrees)):
        return None
    tail = 0.5 * (1.0 - LEVEL)
    ends = [_at(values, variances, float(chi2.ppf(share, degrees))) for share in (1.0 - tail, tail)]
    return Scatter(_at(values, variances, float(degrees)), *ends)


def own_spreads(fitted: Fitted, fits: Sequence[Fitted], force_scatter: float) -> list[IdentifiedParameter]:
    """Return the spreads of the parameters that differ between the objects by more than the fits leave.

    `fitted`: with common values. `fits`: those to each squeeze by itself. `force_scatter`: standard deviation of the
    logarithm of the force's scale between squeezes.
    """
    if not fits:
        return []
    names = [squeeze.instance for squeeze in fitted.squeezes]
    values = np.log([fit.values for fit in fits])
    covariances = np.array([_covariance(fit) for fit in fits])
    stiff, reference = stiffnesses(fitted), reference_stiffness(fitted, values)
    tested = [i for i in range(len(fitted.values)) if i != reference]
    spreads = []
    for i in tested:
        logs, variances = values[:, i], covariances[:, i, i]
        if i in stiff and reference is not None:
            logs = logs - values[:, reference]
            variances = variances + covariances[:, reference, reference] - 2.0 * covariances[:, i, reference]
        elif fitted.candidate.free[i].is_force:
            variances = variances + force_scatter**2
        scatter = _of_objects(logs, variances, names, FALSE_CLAIMS / len(tested))
        if scatter is not None and not fitted.at_bound(i):
            label = fitted.candidate.free[i].label
            basis = "between objects, beyond what a fit to one squeeze leaves"
            spreads.append(identified(f"{label}.spread", min(scatter.value, MOST_SPREAD), scatter[1:], basis))
    return spreads


def _covariance(fitted: Fitted) -> Floats:
    """Return the covariance of the logarithms of the values that one squeeze has by itself."""
    errors = LEAST_ERROR_ALONE**2 + corner_errors(fitted) ** 2
    return linear_covariance(fitted, LEAST_FORCE_ERROR_ALONE) + np.diag(errors)


def _of_objects(logs: Floats, variances: Floats, names: Sequence[str], level: float) -> Scatter | None:
    """Return the scatter between the objects with these names, whose squeezes may differ among themselves, too."""
    known = [i for i in range(len(logs)) if variances[i] <= LARGEST_ERROR**2]
    groups = [[i for i in known if names[i] == name] for name in sorted({names[i] for i in known})]
    if len(groups) < LEAST_INSTANCES:
        return None
    within = _within(logs, variances, groups)
    weights = [1.0 / (variances[group] + within) for group in groups]
    means = [
        float(np.sum(own * logs[group]) / np.sum(own)) for own, group in zip(weights, groups, strict=True)
    ]
    return between(np.array(means), np.array([1.0 / float(np.sum(own)) for own in weights]), level)


def _within(logs: Floats, variances: Floats, groups: Sequence[Sequence[int]]) -> float:
    """Return the variance between squeezes of one object beyond the errors of the fits."""
    degrees = sum(len(group) - 1 for group in groups)
    if degrees == 0:
        return 0.0
    parts = [group for group in groups if len(group) > 1]

    def q(variance: float) -> float:
        return sum(_q(logs[group], variances[group], variance) for group in parts)

    return _root(q, float(degrees))


def _q(values: Floats, variances: Floats, between_objects: float) -> float:
    """Return Cochran's Q: the squares of the deviations over their variances."""
    weights = 1.0 / (variances + between_objects)
    mean = float(np.sum(weights * values) / np.sum(weights))
    return float(np.sum(weights * (values - mean) ** 2))


def _at(values: Floats, variances: Floats, q: float) -> float:
    """Return the standard deviation between objects at which Q has this value; 0 if it is smaller everywhere."""
    return math.sqrt(_root(lambda variance: _q(values, variances, variance), q))


def _root(q_of: Callable[[float], float], q: float) -> float:
    """Return the variance at which a falling function has this value; 0 if it is smaller everywhere."""
    from scipy.optimize import brentq

    if q_of(0.0) <= q:
        return 0.0
    return float(brentq(lambda variance: q_of(variance) - q, 0.0, LARGEST_VARIANCE, xtol=1e-12))
