"""Choosing the terms: every candidate is fitted, and judged by squeezes or stretches that it was not fitted to.

The simplest candidate is chosen whose error on held-out data is not larger than the least one by more than a standard
error of their paired difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import count
from typing import Final, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.simulator_api import CandidateScore
from graspsense_identify.corners import with_corners
from graspsense_identify.fit import LEAST_ERROR, Fitted, fit, in_threads
from graspsense_identify.forward import ForwardModel
from graspsense_identify.laws import DataScale, memories, static_candidates
from graspsense_identify.parts import parts_of
from graspsense_identify.prepare import Squeeze

Floats = NDArray[np.float64]

SQUEEZE_FOLDS: Final = 5
STRETCH_FOLDS: Final = 3
"""Parts of the squeezes, or of a single one, by which a candidate is judged."""
WORTH_TRYING: Final = 3.0
"""A candidate whose fit is worse than the best by this factor is not judged by held-out data, nor tried with a lag."""
MANY: Final = 4
"""Candidates that are usually judged, for the progress."""
MANY_EVALUATIONS: Final = 400
"""Of the chosen fit, so that it converges in a flat valley, too."""
LEAST_GAIN: Final = 0.03
"""A term more has to reduce the error on held-out data by at least this share."""


@frozen(kw_only=True, eq=False)
class Choice:
    """The chosen fit, and the scores of all candidates."""

    fitted: Fitted
    refined: tuple[Fitted, ...]
    """The candidates whose residual is near the least one, chosen or not."""
    scores: tuple[CandidateScore, ...]


class _Judged(NamedTuple):
    fitted: Fitted
    errors: Floats
    """The rms residual over the peak in each held-out part."""

    @property
    def error(self) -> float:
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def logs(self) -> Floats:
        """The logarithms of the errors, in which those below `LEAST_ERROR` hardly differ."""
        return np.log(np.hypot(self.errors, LEAST_ERROR))


def choose(
    model: ForwardModel,
    squeezes: Sequence[Squeeze],
    scale: DataScale,
    has_memory: bool,
    progress: Callable[[int, int], None],
) -> Choice:
    """Return the chosen fit. `has_memory`: whether the squeezes can determine a term with a memory.

    The order of the squeezes changes nothing: folds and fits take them in the order of their forces.
    """
    order = sorted(range(len(squeezes)), key=lambda i: squeezes[i].force_n.tobytes())
    squeezes, given = [squeezes[i] for i in order], np.argsort(order).tolist()
    laws, with_memory = static_candidates(scale), memories(scale) if has_memory else []
    total = (1 + len(with_memory)) * len(laws) + MANY
    numbers = count(1)

    def done() -> None:
        progress(min(next(numbers), total), total)

    fits = in_threads(lambda law: fit(model, with_corners(model, law, squeezes), squeezes), laws, done)
    joined = [own.candidate.joined(memory).starting_at(own.values) for own in fits for memory in with_memory]
    fits += in_threads(lambda law: fit(model, law, squeezes), joined, done)
    dampers = [fitted for fitted in fits if _is_damped_by_branch(fitted)]
    fits = [fitted for fitted in fits if fitted not in dampers]
    least = min(fitted.error for fitted in fits)
    worth = [
        fitted for fitted in fits if fitted.rms <= WORTH_TRYING * least and not _adds_nothing(fitted, fits)
    ]
    judged = in_threads(_judged, worth, done)
    best = _simplest(judged)
    scores = [_score(fitted, best, judged, fits) for fitted in [*fits, *dampers]]
    return Choice(
        fitted=best.fitted.refitted(max_evaluations=MANY_EVALUATIONS).part(given),
        refined=tuple(fitted.part(given) for fitted in fits if fitted.rms <= WORTH_TRYING * least),
        scores=tuple(
            sorted(
                scores, key=lambda own: (not own.chosen, np.nan_to_num(own.error, nan=np.inf), own.fit_error)
            )
        ),
    )


def _is_damped_by_branch(fitted: Fitted) -> bool:
    """Return whether its branch relaxes between two measurements, as a damper does: `loss` says so by one number."""
    free = fitted.candidate.free
    shortest = zip(free, fitted.values, strict=True)
    return any(parameter.name == "tau_s" and value < 1.02 * parameter.low for parameter, value in shortest)


def _adds_nothing(fitted: Fitted, fits: Sequence[Fitted]) -> bool:
    """Return whether a simpler candidate fits as well.

    A parameter more has to reduce the residual by more than it would reduce that of noise (Bayesian information
    criterion, Schwarz 1978), and by `LEAST_GAIN` where the terms of the simpler candidate are among those of this one.
    """
    own = fitted.by_label.keys()
    return any(
        (len(simpler.values) < len(own) and simpler.information < fitted.information)
        or (simpler.by_label.keys() < own and fitted.error > (1.0 - LEAST_GAIN) * simpler.error)
        for simpler in fits
    )


def _judged(fitted: Fitted) -> _Judged:
    """Return the errors of a candidate on squeezes, or on stretches of a single one, that it was not fitted to."""
    folds = SQUEEZE_FOLDS if len(fitted.squeezes) > 1 else STRETCH_FOLDS
    parts = parts_of(fitted, folds).parts
    return _Judged(fitted, np.concatenate([part.errors(own_stiffness=True) for part in parts]))


def _simplest(judged: Sequence[_Judged]) -> _Judged:
    """Return the simplest candidate that is not worse than the best."""
    best = min(judged, key=lambda candidate: float(np.mean(candidate.logs)))
    for candidate in sorted(judged, key=lambda candidate: len(candidate.fitted.values)):
        difference = candidate.logs - best.logs
        spread = float(np.std(difference, ddof=1)) if len(difference) > 1 else 0.0
        error = spread / math.sqrt(len(difference))
        if float(np.mean(difference)) <= max(error, LEAST_GAIN):
            return candidate
    return best


def _score(
    fitted: Fitted, best: _Judged, judged: Sequence[_Judged], fits: Sequence[Fitted]
) -> CandidateScore:
    own = next((candidate for candidate in judged if candidate.fitted is fitted), None)
    if own is best:
        verdict = "chosen"
    elif own is not None:
        more = "more parameters, " if len(fitted.values) > len(best.fitted.values) else ""
        verdict = f"{more}error {100.0 * (own.error / best.error - 1.0):+.0f} %"
    elif fitted not in fits:
        verdict = "its branch relaxes between two measurements: a loss"
    elif _adds_nothing(fitted, fits):
        verdict = "fits no better than with fewer terms"
    else:
        verdict = f"its residual is {fitted.rms / best.fitted.rms:.1f} times that of the chosen terms"
    return CandidateScore(
        terms=fitted.candidate.name,
        parameters=len(fitted.values),
        error=math.nan if own is None else own.error,
        fit_error=fitted.rms,
        verdict=verdict,
        chosen=own is best,
    )
