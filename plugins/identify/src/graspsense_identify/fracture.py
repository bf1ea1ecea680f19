"""The fracture of objects that broke while the fingers closed: at which force or compression, and how it differs.

An object that bears in its next squeeze what it bore before has not broken, however far the force fell.

The force at a break lies between the last measurement before it and what the unbroken object would have borne at the
first measurement after it. Objects that did not break say that theirs is larger. Both are used by maximum likelihood of
a lognormal distribution with censored observations (Lawless, Statistical Models and Methods for Lifetime Data, 2003,
section 5.2).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.simulator_api import IdentifiedParameter, Undetermined
from graspsense_identify.fit import Fitted
from graspsense_identify.interval import LEVEL, NO_INTERVAL, identified, student
from graspsense_identify.prepare import BREAK_SHARE, Squeeze

Floats = NDArray[np.float64]

LIMITS: Final = ("force_n", "compression_m")
"""What an object may bear until it breaks."""
LEAST_BROKEN: Final = 3
"""Objects that have to break before their spread is identified."""
SMALLEST_SPREAD: Final = 1e-4
FALSE_CLAIMS: Final = 0.05
"""The probability with which a spread is claimed that is not there."""
MOST_LEFT: Final = 1.0
SAME_DEPTH: Final = 0.9
"""A squeeze as deep as this share of another one is compared with it."""


class IdentifiedFracture(NamedTuple):
    """What the breaks give: the parameters of the term `fracture`, and what they leave open."""

    parameters: list[IdentifiedParameter]
    """The limit, `force_n` or `compression_m`, the share of the force that is left, and the spread of the limit.

    The spread, the standard deviation of the logarithm between objects, is missing if fewer than three broke, or if
    they differ by no more than the measurements leave open.
    """
    undetermined: list[Undetermined]


def fracture_of(fitted: Fitted, force_scatter: float = 0.0) -> IdentifiedFracture:
    """Return the fracture of these squeezes; nothing if none of them broke the object.

    `force_scatter`: standard deviation of the logarithm of the force's scale between squeezes.
    """
    courses = [_whole(fitted, i) for i in range(len(fitted.squeezes))]
    breaks, survived, errors = ({name: list[float]() for name in LIMITS} for _ in range(3))
    left = []
    for squeeze, course in zip(fitted.squeezes, courses, strict=True):
        for name, values in course.items():
            last, after = float(values[squeeze.sample[-1]]), float(values[-1])
            if squeeze.broken_n is None:
                survived[name].append(float(np.max(values)))
                continue
            # Anywhere between the two measurements.
            breaks[name].append(0.5 * (last + after))
            errors[name].append(abs(math.log(after / last)) / math.sqrt(12.0))
        if squeeze.broken_n is not None:
            left.append(squeeze.broken_n / max(float(course["force_n"][-1]), 1e-9))
    broken = len(left)
    if not broken:
        return IdentifiedFracture([], [])
    fits = {name: _lognormal(np.array(breaks[name]), np.array(survived[name])) for name in breaks}
    name = "force_n"
    if broken >= LEAST_BROKEN and fits["compression_m"][1] < fits["force_n"][1]:
        name = "compression_m"
    mean, spread = fits[name]
    half = student(broken - 1) * spread / math.sqrt(broken) if broken > 1 else math.nan
    basis = f"{broken} of {len(fitted.squeezes)} squeezes broke the object"
    median = min(max(float(np.median(left)), 0.0), MOST_LEFT)
    parameters = [
        identified(f"fracture.{name}", math.exp(mean), (math.exp(mean - half), math.exp(mean + half)), basis),
        identified("fracture.left", median, NO_INTERVAL, "median"),
    ]
    variances = np.array(errors[name]) ** 2 + (force_scatter**2 if name == "force_n" else 0.0)
    if broken >= LEAST_BROKEN and _differ(np.log(breaks[name]), variances + SMALLEST_SPREAD**2):
        parameters.append(identified(f"fracture.{name}.spread", spread, _interval(spread, broken), basis))
    return IdentifiedFracture(parameters, list(_undetermined(fitted.squeezes, broken)))


def _undetermined(squeezes: Sequence[Squeeze], broken: int) -> Iterator[Undetermined]:
    """Yield what so many breaks leave open."""
    if broken < LEAST_BROKEN:
        yield Undetermined(
            what="fracture by force or by compression, and its spread",
            reason=f"{broken} squeezes broke the object",
            remedy=f"break {LEAST_BROKEN} objects or more",
        )
    unseen = broken - sum(squeeze.breaks_for_good for squeeze in squeezes)
    if unseen > 0:
        yield Undetermined(
            what="whether the objects broke",
            reason=f"{unseen} of {broken} falls of the force are in the last squeeze of their object, or in that of an "
            "object without a number",
            remedy="squeeze each object once more after the fall, labelled cup#1, cup#2, cup#3",
        )


def not_broken(squeezes: Sequence[Squeeze]) -> list[int]:
    """Return the squeezes in which the force falls although the object does not break.

    Where one object bears the force again, a fall of which no later squeeze shows more is taken for the same.
    """
    again = [bears_again(squeezes, i) for i in range(len(squeezes))]
    if True not in again:
        return []
    return [i for i, squeeze in enumerate(squeezes) if squeeze.broken_n is not None and again[i] is not False]


def of_whole_objects(squeezes: Sequence[Squeeze]) -> dict[int, Squeeze]:
    """Return the squeezes, by their places, of objects that had not broken before, with what later ones say of a break.

    What is left of an object has another stiffness: it would pass for that of another object.
    """
    kept, broken = dict[int, Squeeze](), set[str]()
    for i, squeeze in enumerate(squeezes):
        if squeeze.instance in broken:
            continue
        breaks = bears_again(squeezes, i) is False
        kept[i] = evolve(squeeze, breaks_for_good=breaks)
        if breaks:
            broken.add(squeeze.instance)
    return kept


def explained_falls(fitted: Fitted) -> set[str]:
    """Return the names of the squeezes whose force falls as that of the fitted, unbroken object does.

    A damped object loses a part of its force when the fingers stop, and no object explains a single wrong measurement
    before the fall.
    """
    return {
        squeeze.name
        for i, squeeze in enumerate(fitted.squeezes)
        if squeeze.broken_n is not None
        and squeeze.broken_n > (1.0 - BREAK_SHARE) * float(_whole(fitted, i)["force_n"][-1])
    }


def bears_again(squeezes: Sequence[Squeeze], i: int) -> bool | None:
    """Return whether the object of a squeeze bears, in its next one, the force that it had before the fall.

    The squeezes are in the order of the recordings. None if the force does not fall in this squeeze, if the object has
    no number, or if no later squeeze of it is as deep.
    """
    squeeze = squeezes[i]
    if squeeze.broken_n is None or not squeeze.instance:
        return None
    depth_m = squeeze.width_m - float(squeeze.gap_m[squeeze.sample[-1]])
    for later in squeezes[i + 1 :]:
        if later.instance == squeeze.instance and later.depth_m >= SAME_DEPTH * depth_m:
            within = later.width_m - later.gap_m[later.sample] <= depth_m / SAME_DEPTH
            return bool(np.max(later.force_n[within]) > (1.0 - BREAK_SHARE) * squeeze.force_n[-1])
    return None


def _differ(logs: Floats, variances: Floats) -> bool:
    """Return whether these values differ by more than errors of these variances make them (Cochran's Q)."""
    from scipy.stats import chi2

    mean = np.average(logs, weights=1.0 / variances)
    return bool(np.sum((logs - mean) ** 2 / variances) > chi2.ppf(1.0 - FALSE_CLAIMS, len(logs) - 1))


def _interval(spread: float, n: int) -> tuple[float, float]:
    """Return the interval of a standard deviation that was estimated from `n` values of a normal distribution."""
    from scipy.stats import chi2

    tail = 0.5 * (1.0 - LEVEL)
    low, high = (spread * math.sqrt((n - 1) / chi2.ppf(share, n - 1)) for share in (1.0 - tail, tail))
    return low, high


def _whole(fitted: Fitted, i: int) -> dict[str, Floats]:
    """Return the forces and compressions that the object would have had at the nodes, if it had not broken."""
    squeeze, width = fitted.squeezes[i], fitted.widths_m[i]
    forces = fitted.model.at_nodes(squeeze, fitted.candidate, fitted.values, width, fitted.factors[i])
    return {"force_n": forces, "compression_m": width - squeeze.gap_m - fitted.model.compressed_m(forces)}


def _lognormal(breaks: Floats, survived: Floats) -> tuple[float, float]:
    """Return mean and standard deviation of the logarithm; the deviation is 0 for a single break."""
    from scipy.stats import CensoredData, norm

    logs, beyond = np.log(breaks), np.log(np.maximum(survived, 1e-12))
    mean = float(np.mean(logs))
    if len(logs) < 2:
        return mean, 0.0
    deviation = max(float(np.std(logs, ddof=1)), SMALLEST_SPREAD)
    if not len(beyond) or float(np.max(beyond)) < mean - 4.0 * deviation:
        return mean, deviation
    likeliest = norm.fit(CensoredData(uncensored=logs, right=beyond), loc=mean, scale=deviation)
    return float(likeliest[0]), float(likeliest[1])
