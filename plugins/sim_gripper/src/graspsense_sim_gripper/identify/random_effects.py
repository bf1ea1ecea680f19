"""Spreads of single parameters: which of them differ between objects by more than their fits leave open.

Each squeeze is fitted alone. The logarithm of a parameter is that of its object, plus a difference of this squeeze,
plus an error of the fit whose variance the linearised fit gives (random effects). A variance between objects is claimed
where Cochran's Q is improbable without one. Its estimate is that of Paule and Mandel (J. Res. Natl. Bur. Stand. 87,
1982): Q is its expectation. The interval holds the variances at which Q is not improbable (Viechtbauer, Statistics in
Medicine 26, 2007).

Common values that do not hold for all objects fit badly, and a law with more terms, or a lag, may mimic that. So a
simpler law with values of each squeeze is taken instead of the chosen one where it has more evidence, and the lag is
then that of a single squeeze.

All stiffnesses of an object vary together by the `stiffness_spread` of a scene. A stiffness has a spread of its own
where its ratio to the one that differs least varies.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.plugin_api import IdentifiedParameter
from graspsense_sim_gripper.identify.choose import Choice, chosen_instead
from graspsense_sim_gripper.identify.delay import EVIDENCE, Lag, lag_beyond_settings
from graspsense_sim_gripper.identify.fit import LEAST_ERROR, Fitted, fit, linear_covariance
from graspsense_sim_gripper.identify.forward import ForwardModel
from graspsense_sim_gripper.identify.interval import LEVEL
from graspsense_sim_gripper.identify.laws import GAS, SLOTS
from graspsense_sim_gripper.identify.prepare import Squeeze
from graspsense_sim_gripper.identify.spread import (
    LEAST_INSTANCES,
    corner_errors,
)
from graspsense_sim_gripper.identify.threads import in_threads
from graspsense_sim_gripper.objects.spec import MOST_SPREAD
from graspsense_sim_gripper.terms.registry import find_term

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


class OwnSpread(NamedTuple):
    """The spread of a parameter that differs between objects, by its place among the free ones."""

    place: int
    scatter: Scatter


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


def alone(model: ForwardModel, fitted: Fitted, squeezes: Sequence[Squeeze]) -> list[Fitted]:
    """Return the fits of a candidate to each squeeze by itself; none with fewer than three objects with names."""
    names = {one.instance for one in squeezes}
    if "" in names or len(names) < LEAST_INSTANCES:
        return []
    return in_threads(lambda i: _alone(model, fitted, squeezes[i], i), range(len(squeezes)))


class Individual(NamedTuple):
    """A choice, and the fits of its candidate to each squeeze by itself."""

    choice: Choice
    fits: list[Fitted]
    """None with fewer than three objects with names."""
    varies: bool
    """Whether common values fit worse than noise would make them."""

    def lag(self, model: ForwardModel, squeezes: Sequence[Squeeze]) -> Lag:
        """Return the lag of the force beyond the settings."""
        if not self.varies:
            return lag_beyond_settings(model, self.choice.refined, squeezes)
        first = in_threads(lambda one: _alone(model, one, squeezes[0], 0), self.choice.refined)
        return lag_beyond_settings(model, first, squeezes[:1])

    @property
    def of_each(self) -> Fitted:
        """The chosen fit with the width of each squeeze, and its factor on the stiffness: where the values vary, those
        that it has by itself."""
        fitted = self.choice.fitted
        if not self.varies:
            return fitted
        values = np.log([one.values for one in self.fits])
        reference = _reference(fitted, values)
        logs = np.log(fitted.factors) if reference is None else values[:, reference]
        return evolve(
            fitted,
            widths_m=tuple(one.widths_m[0] for one in self.fits),
            factors=tuple(np.exp(logs - logs.mean()).tolist()),
        )


def simplest_alone(model: ForwardModel, choice: Choice, squeezes: Sequence[Squeeze]) -> Individual:
    """Return the choice, or that of a simpler candidate whose values differ between objects."""
    own = alone(model, choice.fitted, squeezes)
    if not own or _evidence(own) > _common_evidence(choice.fitted) - EVIDENCE:
        return Individual(choice, own, varies=False)
    simpler = [one for one in choice.refined if one.parameters < choice.fitted.parameters]
    for one in sorted(simpler, key=lambda one: (one.parameters, one.cost)):
        fits = alone(model, one, squeezes)
        if _evidence(fits) < min(_evidence(own), _common_evidence(choice.fitted)) - EVIDENCE:
            chosen = chosen_instead(choice, one, "simpler, with values of each object")
            return Individual(chosen, fits, varies=True)
    return Individual(choice, own, varies=True)


def _evidence(fits: Sequence[Fitted]) -> float:
    """Return half of the Bayesian information criterion of fits to each squeeze, less a constant."""
    residuals = np.concatenate([one.residuals for one in fits])
    free = sum(len(one.values) for one in fits)
    return _information(float(np.sqrt(np.mean(residuals**2))), free, len(residuals))


def _common_evidence(fitted: Fitted) -> float:
    """Return that of a fit with common values, and a factor of each squeeze on the stiffness."""
    return _information(fitted.rms, len(fitted.values) + len(fitted.factors) - 1, len(fitted.residuals))


def _information(rms: float, free: int, n: int) -> float:
    return n * math.log(math.hypot(rms, LEAST_ERROR)) + 0.5 * free * math.log(n)


def own_spreads(
    model: ForwardModel,
    fitted: Fitted,
    fits: Sequence[Fitted],
    squeezes: Sequence[Squeeze],
    force_scatter: float,
) -> list[OwnSpread]:
    """Return the parameters that differ between the objects by more than the fits leave.

    `fitted`: with common values. `fits`: those to each squeeze by itself. `force_scatter`: standard deviation of the
    logarithm of the force's scale between squeezes.
    """
    if not fits:
        return []
    names = [one.instance for one in squeezes]
    values = np.log([one.values for one in fits])
    covariances = np.array([_covariance(model, *each) for each in zip(fits, squeezes, strict=True)])
    stiff, reference = _stiffnesses(fitted), _reference(fitted, values)
    tested = [i for i, one in enumerate(fitted.candidate.free) if i != reference and one.slot != GAS]
    found = []
    for i in tested:
        logs, variances = values[:, i], covariances[:, i, i]
        if i in stiff and reference is not None:
            logs = logs - values[:, reference]
            variances = variances + covariances[:, reference, reference] - 2.0 * covariances[:, i, reference]
        elif fitted.candidate.free[i].is_force:
            variances = variances + force_scatter**2
        scatter = _of_objects(logs, variances, names, FALSE_CLAIMS / len(tested))
        if scatter is not None and not fitted.at_bound(i):
            found.append(OwnSpread(i, scatter))
    return found


def _stiffnesses(fitted: Fitted) -> list[int]:
    return [i for i, one in enumerate(fitted.candidate.free) if _is_stiffness(one.slot, one.name)]


def _reference(fitted: Fitted, values: Floats) -> int | None:
    """Return the stiffness that differs least between the squeezes: the others vary with it, and beyond it."""
    return min(_stiffnesses(fitted), key=lambda i: float(np.var(values[:, i])), default=None)


def as_parameters(fitted: Fitted, spreads: Sequence[OwnSpread]) -> list[IdentifiedParameter]:
    """Return the spreads as identified parameters."""
    return [
        IdentifiedParameter(
            name=f"{fitted.candidate.free[place].label}.spread",
            unit="",
            value=min(scatter.value, MOST_SPREAD),
            low=scatter.low,
            high=scatter.high,
            basis="between objects, beyond what a fit to one squeeze leaves",
        )
        for place, scatter in spreads
    ]


def _is_stiffness(slot: int, name: str) -> bool:
    return name in find_term(SLOTS[slot])[1].stiffnesses


def _alone(model: ForwardModel, fitted: Fitted, squeeze: Squeeze, i: int) -> Fitted:
    factor = fitted.factors[i]
    own = tuple(
        value * factor if _is_stiffness(one.slot, one.name) else value
        for one, value in zip(fitted.candidate.free, fitted.values, strict=True)
    )
    start = evolve(fitted, values=own, widths_m=(fitted.widths_m[i],), factors=(1.0,))
    return fit(model, fitted.candidate, [squeeze], start=start)


def _covariance(model: ForwardModel, fitted: Fitted, squeeze: Squeeze) -> Floats:
    """Return the covariance of the logarithms of the values that one squeeze has by itself."""
    errors = LEAST_ERROR_ALONE**2 + corner_errors(fitted, [squeeze]) ** 2
    return linear_covariance(model, fitted, [squeeze], LEAST_FORCE_ERROR_ALONE) + np.diag(errors)


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
