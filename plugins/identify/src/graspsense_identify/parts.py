"""Parts of the recordings that are left out in turn: the fit to the others, and how well it predicts them.

A part is the squeezes of an object if there are three objects, else a squeeze. Of a single squeeze, it is a stretch.
The scatter of the fits gives intervals by the delete-a-group jackknife (Shao and Tu, The Jackknife and Bootstrap, 1995,
section 2.3) with Student's t.

Of a recording that is left out nothing was used. It has only a width of its own, which is where the object stands
between the fingers: a sensor of 24 Hz shows it to some 0.4 mm. Its stiffness is the mean of the others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense_identify.fit import FACTOR_RANGE, STEP, TOLERANCE, WIDTH_RANGE, Fitted, in_threads, relative
from graspsense_identify.interval import student
from graspsense_identify.prepare import Squeeze

Floats = NDArray[np.float64]

MAX_PARTS: Final = 10
"""Objects or squeezes beyond this number are left out several at a time, and so many stretches has a squeeze."""
LEAST_INSTANCES: Final = 3


class Part(NamedTuple):
    """What is left out, and the fit to the others."""

    fitted: Fitted
    left_out: Fitted
    """The squeezes that are left out, or the stretch, at the values of the fit to all."""
    places: tuple[int, ...]
    """Of these squeezes among all; nothing for a stretch."""

    def errors(self, *, own_stiffness: bool = False) -> list[float]:
        """Return the rms error over the peak of each squeeze that is left out, or of the stretch.

        `own_stiffness`: whether a squeeze has a factor of its own on the stiffness, too. A stretch has the width of the
        rest of its squeeze.
        """
        others, left_out = self.fitted, self.left_out
        if not self.places:
            (squeeze,), (forces,) = left_out.squeezes, evolve(others, squeezes=left_out.squeezes).forces()
            return [float(np.sqrt(np.mean(relative(forces - squeeze.force_n, squeeze.peak_n) ** 2)))]
        beyond_m = float(
            np.mean(np.array(others.widths_m) - [squeeze.width_m for squeeze in others.squeezes])
        )
        # With a stiffness of its own, a width far from that of the fit may lead to another minimum.
        widths_m = (
            left_out.widths_m if own_stiffness else [own.width_m + beyond_m for own in left_out.squeezes]
        )
        return [
            _predicted_rms(others, squeeze, width_m, own_stiffness)
            for squeeze, width_m in zip(left_out.squeezes, widths_m, strict=True)
        ]


class Parts(NamedTuple):
    """All parts, and of what their scatter is."""

    parts: Sequence[Part]
    basis: str

    @property
    def factor(self) -> float:
        """Half the width of the interval, in standard deviations."""
        return student(len(self.parts) - 1)

    def covariance(self, values: Floats) -> Floats:
        """Return the covariance of quantities, from their values in the fit without each part (a row for each)."""
        deviations = values - values.mean(axis=0)
        covariance: Floats = (len(values) - 1) / len(values) * deviations.T @ deviations
        return covariance

    @property
    def squeeze_errors(self) -> tuple[float, ...]:
        """The error of each squeeze as the others predict it, in their order; nothing for a single squeeze."""
        by_place = {
            place: error
            for part in self.parts
            if part.places
            for place, error in zip(part.places, part.errors(), strict=True)
        }
        return tuple(by_place[place] for place in sorted(by_place))


def parts_of(fitted: Fitted, most: int = MAX_PARTS, *, has_lag: bool = False) -> Parts:
    """Return the parts of the squeezes of a fit, at most so many. `has_lag`: whether the fits have a lag."""
    squeezes = fitted.squeezes
    if len(squeezes) == 1:
        (squeeze,) = squeezes
        number = np.arange(len(squeeze.force_n)) * MAX_PARTS // len(squeeze.force_n)
        basis = "within one squeeze; not between squeezes"
    else:
        is_object = has_objects(squeezes)
        names = [squeeze.instance if is_object else str(i) for i, squeeze in enumerate(squeezes)]
        number = np.unique(names, return_inverse=True)[1]
        g = int(np.max(number)) + 1
        what = "groups" if g > most else "objects" if is_object else "squeezes"
        basis = f"between {min(g, most)} {what}"
    number = number % most

    def without(k: int) -> Part:
        is_out = number == k
        if len(squeezes) == 1:
            others, stretch = (evolve(fitted, squeezes=[squeezes[0].only(own)]) for own in (~is_out, is_out))
            return Part(others.refitted(has_lag=has_lag), stretch, ())
        places = tuple(np.flatnonzero(is_out).tolist())
        others = fitted.part(np.flatnonzero(~is_out).tolist())
        return Part(others.refitted(has_lag=has_lag), fitted.part(places), places)

    return Parts(in_threads(without, np.unique(number).tolist()), basis)


def has_objects(squeezes: Sequence[Squeeze]) -> bool:
    """Return whether every squeeze is of an object with a number, and there are at least three of these."""
    names = {squeeze.instance for squeeze in squeezes}
    return "" not in names and len(names) >= LEAST_INSTANCES


def means_of_objects(squeezes: Sequence[Squeeze], values: Sequence[float]) -> list[float]:
    """Return the mean of a quantity over the squeezes of each object, which differ less than objects do."""
    if not has_objects(squeezes):
        return list(values)
    by_object: dict[str, list[float]] = {}
    for squeeze, value in zip(squeezes, values, strict=True):
        by_object.setdefault(squeeze.instance, []).append(value)
    return [float(np.mean(own)) for own in by_object.values()]


def _predicted_rms(fitted: Fitted, squeeze: Squeeze, width_m: float, own_stiffness: bool) -> float:
    """Return the rms residual over the peak of a squeeze that was not fitted. `width_m`: the width to start from."""
    from scipy.optimize import least_squares

    squeeze = squeeze.delayed(fitted.lag_s)

    def residuals(x: Floats) -> Floats:
        factor = math.exp(x[1]) if own_stiffness else 1.0
        width = width_m + x[0] * squeeze.depth_m
        forces = fitted.model.forces(squeeze, fitted.candidate, fitted.values, width, factor)
        return relative(forces - squeeze.force_n, squeeze.peak_n)

    limits = np.array([WIDTH_RANGE, FACTOR_RANGE][: 1 + own_stiffness])
    start, steps = np.zeros(len(limits)), [STEP] * len(limits)
    solution = least_squares(
        residuals, start, bounds=(-limits, limits), max_nfev=15, diff_step=steps, ftol=TOLERANCE
    )
    return float(np.sqrt(np.mean(solution.fun**2)))
