"""Choosing the terms: every candidate is fitted, and judged by squeezes or stretches that it was not fitted to.

The simplest candidate is chosen whose error on held-out data is not larger than the least one by more than a standard
error of their paired difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense.simulator_api import CandidateScore
from graspsense_identify.corners import with_corners
from graspsense_identify.fit import LEAST_ERROR, Fitted, Mask, fit, fit_to, held_out_rms
from graspsense_identify.forward import ForwardModel
from graspsense_identify.laws import GAS, CandidateLaw, DataScale, memories, static_candidates
from graspsense_identify.prepare import Squeeze
from graspsense_identify.threads import in_threads

MAX_FOLDS: Final = 5
STRETCHES: Final = 9
STRETCH_FOLDS: Final = 3
STATIC_KEPT: Final = 3
"""Static laws that are tried with every memory."""
WORTH_REFINING: Final = 4.0
"""A candidate whose direct fit is worse than the best by this factor is not refined."""
MANY: Final = 4
"""Candidates that are usually refined and judged, for the progress."""
WORTH_TRYING: Final = 3.0
"""A candidate whose fit is worse than the best by this factor is not judged by held-out data."""
MANY_EVALUATIONS: Final = 400
"""Of the chosen fit, so that it converges in a flat valley, too."""
LEAST_GAIN: Final = 0.03
"""A term more has to reduce the error on held-out data by at least this share."""


@frozen(kw_only=True, eq=False)
class Choice:
    """The chosen fit, and the scores of all candidates."""

    fitted: Fitted
    refined: tuple[Fitted, ...]
    """The candidates whose direct fit was near the best, chosen or not."""
    scores: tuple[CandidateScore, ...]


@frozen(kw_only=True, eq=False)
class _Judged:
    fitted: Fitted
    errors: NDArray[np.float64]
    """The rms residual over the peak in each held-out part."""


def choose(
    model: ForwardModel,
    squeezes: Sequence[Squeeze],
    scale: DataScale,
    *,
    has_memory: bool,
    progress: Callable[[int, int], None],
) -> Choice:
    """Return the chosen fit. `has_memory`: whether the squeezes can determine a term with a memory."""
    direct = evolve(model, direct=True)
    statics = static_candidates(scale)
    with_memory = memories(scale) if has_memory else []
    counter = _Counter(
        (3 if with_memory else 1) * len(statics) + (STATIC_KEPT + 1) * (1 + len(with_memory)) + 2 * MANY,
        progress,
    )
    rough = _rough(direct, statics, squeezes, with_memory, counter)
    kept = _kept(rough)
    candidates = [
        joined.starting_at(_values(rough[k]))
        for k in kept
        for joined in (statics[k], *_joined(statics[k], with_memory))
    ]
    directly = in_threads(lambda candidate: fit(direct, candidate, squeezes), candidates, counter.done)
    least_directly = max(min(fitted.rms for fitted in directly), LEAST_ERROR)
    near = [fitted for fitted in directly if fitted.rms <= WORTH_REFINING * least_directly]
    fits = in_threads(lambda fitted: refined(model, fitted, squeezes), near, counter.done)
    least = max(min(fitted.rms for fitted in fits), LEAST_ERROR)
    worth = [
        fitted for fitted in fits if fitted.rms <= WORTH_TRYING * least and not _adds_nothing(fitted, fits)
    ]
    judged = in_threads(lambda fitted: _judged(model, fitted, squeezes), worth, counter.done)
    best = _simplest(judged)
    converged = fit(
        model, best.fitted.candidate, squeezes, start=best.fitted, max_evaluations=MANY_EVALUATIONS
    )
    names = {fitted.candidate.name for fitted in fits}
    only_directly = [fitted for fitted in directly if fitted.candidate.name not in names]
    only_directly += [fitted for k, fitted in enumerate(rough) if k not in kept]
    scores = [_score(fitted, best, judged, fits) for fitted in fits]
    dropped = [
        CandidateScore(
            terms=fitted.candidate.name,
            parameters=len(fitted.values),
            error=math.nan,
            fit_error=fitted.rms,
            verdict=_dropped(fitted.rms / least_directly),
        )
        for fitted in only_directly
    ]
    ranked = (*sorted(scores, key=_rank), *sorted(dropped, key=_rank))
    return Choice(fitted=converged, refined=tuple(fits), scores=ranked)


def _rough(
    direct: ForwardModel,
    statics: Sequence[CandidateLaw],
    squeezes: Sequence[Squeeze],
    with_memory: Sequence[CandidateLaw],
    counter: _Counter,
) -> list[Fitted]:
    """Return the direct fit of each law without memory: alone, or with a branch if the squeezes show a memory."""
    alone = in_threads(
        lambda law: fit(direct, with_corners(direct, law, squeezes), squeezes), statics, counter.done
    )
    if not with_memory:
        return alone
    # From its own starts, and from the fit without a memory, which has found the corners of the law.
    roughly = [static.joined(with_memory[1]) for static in statics]
    roughly += [law.starting_at(_values(own)) for law, own in zip(roughly, alone, strict=True)]
    tried = in_threads(lambda law: fit(direct, law, squeezes), roughly, counter.done)
    pairs = zip(tried[: len(statics)], tried[len(statics) :], strict=True)
    return [min(pair, key=lambda fitted: fitted.cost) for pair in pairs]


def refined(model: ForwardModel, directly: Fitted, squeezes: Sequence[Squeeze]) -> Fitted:
    """Return the fit of a candidate through the fingertips, from its direct fit.

    The direct fit of a snap-through may prefer the wrong corners, since noise and lag bias it most where the force
    falls. So the corners are tried once more.
    """
    fitted = fit(model, directly.candidate, squeezes, start=directly)
    law = with_corners(model, directly.candidate, squeezes)
    if not law.more_starts:
        return fitted
    return min(fitted, fit(model, law, squeezes), key=lambda either: either.cost)


def _dropped(times: float) -> str:
    """Return why a candidate with so many times the least direct residual was not refined."""
    if times > WORTH_REFINING:
        return f"its direct residual is {times:.1f} times the least"
    return f"not among the {STATIC_KEPT} laws that fit best directly"


def chosen_instead(choice: Choice, fitted: Fitted, verdict: str) -> Choice:
    """Return the choice of another of the refined candidates."""
    scores = [
        evolve(score, chosen=True, verdict=f"chosen: {verdict}")
        if score.terms == fitted.candidate.name
        else evolve(score, chosen=False, verdict="only common values need its terms")
        if score.chosen
        else score
        for score in choice.scores
    ]
    return Choice(fitted=fitted, refined=choice.refined, scores=tuple(sorted(scores, key=_rank)))


def _kept(rough: Sequence[Fitted]) -> list[int]:
    """Return which laws are tried with every memory: those that fit best."""
    order = np.argsort([fitted.cost for fitted in rough], kind="stable").tolist()
    # A gas takes no other law's place: it resembles a spring that stiffens.
    solid = [k for k in order if GAS not in rough[k].candidate.slots][:STATIC_KEPT]
    # The simplest law stays among the candidates, so that the table shows what it costs to leave the others out.
    return sorted({0, *solid, *order[:STATIC_KEPT]})


def _joined(static: CandidateLaw, with_memory: Sequence[CandidateLaw]) -> list[CandidateLaw]:
    """Return a law with each memory whose terms it does not have already."""
    return [static.joined(law) for law in with_memory if static.can_join(law)]


def _adds_nothing(fitted: Fitted, fits: Sequence[Fitted]) -> bool:
    """Return whether a simpler candidate fits as well.

    A parameter more has to reduce the residual by more than it would reduce that of noise (Bayesian information
    criterion, Schwarz 1978), and by `LEAST_GAIN` where the terms of the simpler candidate are among those of this one.
    """
    for simpler in fits:
        more = len(fitted.values) - len(simpler.values)
        if more > 0 and information(simpler) < information(fitted):
            return True
        if _contains(fitted, simpler) and least_error(fitted) > (1.0 - LEAST_GAIN) * least_error(simpler):
            return True
    return False


def _contains(fitted: Fitted, simpler: Fitted) -> bool:
    free, fewer = (
        {(parameter.slot, parameter.name) for parameter in each.candidate.free} for each in (fitted, simpler)
    )
    return fewer < free


def information(fitted: Fitted) -> float:
    """Return half of the Bayesian information criterion, less a constant: smaller is better."""
    return information_of(fitted.rms, fitted.parameters, len(fitted.residuals))


def information_of(rms: float, parameters: int, n: int) -> float:
    """Return that of a fit to so many residuals with this rms."""
    return n * math.log(math.hypot(rms, LEAST_ERROR)) + 0.5 * parameters * math.log(n)


def least_error(fitted: Fitted) -> float:
    """Return the rms residual, in which those below `LEAST_ERROR` hardly differ."""
    return math.hypot(fitted.rms, LEAST_ERROR)


def _rank(score: CandidateScore) -> tuple[bool, float, float]:
    """Return the key of the order of the table: the chosen candidate, then by the error on held-out data."""
    return not score.chosen, math.inf if math.isnan(score.error) else score.error, score.fit_error


class _Counter:
    """Counts what is done, for the progress."""

    def __init__(self, total: int, progress: Callable[[int, int], None]) -> None:
        self._n, self._total, self._progress = 0, total, progress

    def done(self) -> None:
        self._n += 1
        self._progress(min(self._n, self._total), self._total)


def _values(fitted: Fitted) -> dict[str, float]:
    return {
        parameter.label: value for parameter, value in zip(fitted.candidate.free, fitted.values, strict=True)
    }


def _judged(model: ForwardModel, fitted: Fitted, squeezes: Sequence[Squeeze]) -> _Judged:
    """Return the errors of a candidate on data that it was not fitted to."""
    n = len(squeezes)
    errors: list[float] = []
    if n == 1:
        for mask in _stretch_masks(squeezes[0]):
            part = fit(model, fitted.candidate, squeezes, [~mask], start=fitted)
            everywhere = fit_residuals(model, part, squeezes[0])
            errors.append(float(np.sqrt(np.mean(everywhere[mask] ** 2))))
        return _Judged(fitted=fitted, errors=np.array(errors))
    folds = min(n, MAX_FOLDS)
    for k in range(folds):
        part = fit_to(model, fitted, squeezes, [i for i in range(n) if i % folds != k])
        errors += [
            held_out_rms(model, part, squeezes[i], fitted.widths_m[i], own_stiffness=True)
            for i in range(n)
            if i % folds == k
        ]
    return _Judged(fitted=fitted, errors=np.array(errors))


def fit_residuals(model: ForwardModel, fitted: Fitted, squeeze: Squeeze) -> NDArray[np.float64]:
    """Return the residuals of a fit to one squeeze at all of its samples, relative to the peak."""
    if fitted.lag_s != 0.0:
        squeeze = squeeze.delayed(fitted.lag_s)
    forces = model.forces(squeeze, fitted.candidate, fitted.values, fitted.widths_m[0], fitted.factors[0])
    return (forces - squeeze.force_n) / squeeze.peak_n


def _stretch_masks(squeeze: Squeeze) -> list[Mask]:
    """Return the samples that are held out in each fold: every third of nine stretches."""
    number = np.minimum(np.arange(len(squeeze.force_n)) * STRETCHES // len(squeeze.force_n), STRETCHES - 1)
    return [number % STRETCH_FOLDS == k for k in range(STRETCH_FOLDS)]


def _simplest(judged: Sequence[_Judged]) -> _Judged:
    """Return the simplest candidate that is not worse than the best."""
    best = min(judged, key=lambda candidate: float(np.mean(_logarithms(candidate))))
    for candidate in sorted(judged, key=lambda candidate: len(candidate.fitted.values)):
        difference = _logarithms(candidate) - _logarithms(best)
        spread = float(np.std(difference, ddof=1)) if len(difference) > 1 else 0.0
        error = spread / math.sqrt(len(difference))
        if float(np.mean(difference)) <= max(error, LEAST_GAIN):
            return candidate
    return best


def _logarithms(judged: _Judged) -> NDArray[np.float64]:
    """Return the logarithms of the errors, in which those below `LEAST_ERROR` hardly differ."""
    result: NDArray[np.float64] = 0.5 * np.log(judged.errors**2 + LEAST_ERROR**2)
    return result


def _score(
    fitted: Fitted, best: _Judged, judged: Sequence[_Judged], fits: Sequence[Fitted]
) -> CandidateScore:
    own = next((candidate for candidate in judged if candidate.fitted is fitted), None)
    error = math.nan if own is None else float(np.sqrt(np.mean(own.errors**2)))
    least = float(np.sqrt(np.mean(best.errors**2)))
    if own is best:
        verdict = "chosen"
    elif own is None and _adds_nothing(fitted, fits):
        verdict = "fits no better than with fewer terms"
    elif own is None:
        verdict = f"its residual is {fitted.rms / best.fitted.rms:.1f} times that of the chosen terms"
    elif len(fitted.values) > len(best.fitted.values):
        verdict = f"more parameters, error {100.0 * (error / least - 1.0):+.0f} %"
    else:
        verdict = f"error {100.0 * (error / least - 1.0):+.0f} %"
    return CandidateScore(
        terms=fitted.candidate.name,
        parameters=len(fitted.values),
        error=error,
        fit_error=fitted.rms,
        verdict=verdict,
        chosen=own is best,
    )
