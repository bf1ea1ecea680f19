"""Recognition at checkpoints of a grasp: the models of the checkpoints, and what an early end costs and saves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense.core.learn.checkpoints import CheckpointTrials
from graspsense.core.learn.conformal import exchangeable_instances
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model import Model, checkpoint_model
from graspsense.core.learn.training import train
from graspsense.core.settings.selected import SelectedComponent
from graspsense.evaluation.crossval import cross_validate
from graspsense.evaluation.doubt import HeldOut, calibrated, calibrated_by
from graspsense.evaluation.folds import Folds, held_out, held_out_protocol
from graspsense.evaluation.intervals import RecognitionRate, rate_among

WHOLE: Final = "whole grasp"
SURE: Final = "stop when sure"


def checkpoint_models(
    whole: Model,
    learner: SelectedComponent,
    parts: Sequence[CheckpointTrials],
    seed: int,
    further: Sequence[CheckpointTrials] = (),
) -> tuple[tuple[float, Model], ...]:
    """Return a model for each checkpoint, trained on the same part of the trials that reach it.

    It is calibrated with the same part of `further` trials of other objects, or without them by cross-validation.
    Raises ConfigError if nothing can be learned from them.
    """
    models = []
    for k, part in enumerate(parts):
        assert part.after_s is not None
        labelled = part.labelled
        model = train(
            learner.component, learner.config, labelled, name=whole.name, seed=seed, target=whole.target
        )
        model = (
            calibrated_by(model, further[k].labelled)
            if further
            else calibrated(model, learner, labelled, seed)
        )
        models.append((part.after_s, checkpoint_model(whole, part.after_s, model)))
    return tuple(models)


@frozen(kw_only=True)
class EarlyRate:
    """The recognition rate of answers that are given at one time of each grasp, and what they cost.

    `name` is a checkpoint (`0.2 s`), `WHOLE` or `SURE`. `seconds` is the mean time from the contact to the answer, and
    `newtons` the mean over the grasps of the largest force of the pads until then (None without any). `covered` is the
    share of the prediction sets with the true label, and `single` that of the sets with one label; for `SURE`, they are
    the rate among the grasps that were ended early, and their share. They are None without sets.
    """

    name: str
    rate: RecognitionRate
    seconds: float
    newtons: float | None
    covered: RecognitionRate | None = None
    single: RecognitionRate | None = None


@frozen(kw_only=True)
class EarlyRecognition:
    """Recognition at each checkpoint, of whole grasps, and with the end of a squeeze that is sure.

    `protocol` says how trials were held out. `reason` says why there are no sets, and so no row `SURE`.
    """

    protocol: str
    rows: tuple[EarlyRate, ...]
    reason: str = ""


def early_recognition(
    learner: SelectedComponent, parts: Sequence[CheckpointTrials], *, folds: int = 10, seed: int = 0
) -> EarlyRecognition:
    """Return the recognition at the checkpoints of these trials, and last of the whole grasps, on the same folds.

    Whole instances are held out where they are known. At each checkpoint, a model of the other folds answers for the
    trials that reach it, from the same part of the trials. A trial that has ended before keeps the answer of its whole
    grasp. Raises ConfigError if the trials cannot be divided into folds.
    """
    whole = parts[-1].labelled
    instances = exchangeable_instances(whole)
    fold_of = held_out(whole.labels, instances, folds, seed)
    answers = [_answers(learner, part, instances, fold_of, seed) for part in parts]
    ended = answers[-1].predicted
    rows = []
    for part, answer in zip(parts, answers, strict=True):
        predicted = [a or b for a, b in zip(answer.predicted, ended, strict=True)]
        name = WHOLE if part.after_s is None else f"{part.after_s:g} s"
        rows.append(_row(name, whole, part, answer, predicted, folds))
    reason = next((answer.reason for answer in answers if answer.reason), "")
    if not reason:
        rows.append(_stopped(whole, parts, answers, folds))
    return EarlyRecognition(
        protocol="stratified" if instances is None else held_out_protocol(whole),
        rows=tuple(rows),
        reason=reason,
    )


@frozen(kw_only=True, eq=False)
class _Answers:
    """The answers at one checkpoint, for all trials: empty for one that does not reach it.

    `sizes` is the number of labels in the prediction set, 0 if it is unknown, and `covered` whether the true one is
    among them; without sets, `reason` says why.
    """

    predicted: tuple[str, ...]
    sizes: NDArray[np.int64]
    covered: NDArray[np.bool_]
    reason: str = ""


def _answers(
    learner: SelectedComponent,
    part: CheckpointTrials,
    instances: Sequence[str] | None,
    fold_of: Folds,
    seed: int,
) -> _Answers:
    numbers, n, folds = part.rows.tolist(), len(fold_of), fold_of[part.rows]
    own = None if instances is None else tuple(instances[i] for i in numbers)
    labels = part.labelled.labels
    pooled = cross_validate(learner, part.labelled.table, labels, folds, seed=seed)
    predicted = [""] * n
    for i, label in zip(numbers, pooled.predicted, strict=True):
        predicted[i] = label
    sizes, covered, reason = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.bool_), ""
    inside = HeldOut(answers=pooled, trials=evolve(part.labelled, instances=own), folds=folds).members()
    if isinstance(inside, str):
        reason = inside
    else:
        sizes[part.rows] = np.where(pooled.unlike, 0, inside.sum(axis=1))
        covered[part.rows] = inside[np.arange(len(labels)), pooled.columns_of(labels)]
    return _Answers(predicted=tuple(predicted), sizes=sizes, covered=covered, reason=reason)


def _row(
    name: str,
    whole: Labelled,
    part: CheckpointTrials,
    answers: _Answers,
    predicted: Sequence[str],
    folds: int,
) -> EarlyRate:
    reached = part.rows.tolist()
    right = [a == b for a, b in zip(predicted, whole.labels, strict=True)]
    return EarlyRate(
        name=name,
        rate=rate_among(whole, right, folds=folds),
        seconds=_mean(part.used_s) or 0.0,
        newtons=_mean(part.used_n),
        covered=None if answers.reason else rate_among(whole, answers.covered.tolist(), reached, folds),
        single=None if answers.reason else rate_among(whole, (answers.sizes == 1).tolist(), reached, folds),
    )


def _stopped(
    whole: Labelled, parts: Sequence[CheckpointTrials], answers: Sequence[_Answers], folds: int
) -> EarlyRate:
    """Return the rate if each squeeze ends at the first checkpoint at which the set has one label."""
    predicted, seconds, newtons = (
        list(answers[-1].predicted),
        parts[-1].used_s.copy(),
        parts[-1].used_n.copy(),
    )
    stopped = np.zeros(len(whole), dtype=np.bool_)
    for part, answer in zip(parts[:-1], answers[:-1], strict=True):
        now = (answer.sizes == 1) & ~stopped
        for i in np.flatnonzero(now).tolist():
            predicted[i] = answer.predicted[i]
        seconds[now], newtons[now] = part.used_s[now], part.used_n[now]
        stopped |= now
    right = [a == b for a, b in zip(predicted, whole.labels, strict=True)]
    early = np.flatnonzero(stopped).tolist()
    return EarlyRate(
        name=SURE,
        rate=rate_among(whole, right, folds=folds),
        seconds=_mean(seconds) or 0.0,
        newtons=_mean(newtons),
        covered=rate_among(whole, right, early, folds) if early else None,
        single=rate_among(whole, stopped.tolist(), folds=folds),
    )


def _mean(values: NDArray[np.float64]) -> float | None:
    """Return the mean of the values that are known, None if none is."""
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else None
