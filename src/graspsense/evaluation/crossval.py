"""Cross validation: each trial is predicted once, by a model that was trained on the other folds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from typing import Any, Protocol

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.core.components.roles import Classifier
from graspsense.core.learn.conformal import scores_of
from graspsense.core.learn.model import refuse_improbable, refuse_unsupported
from graspsense.core.learn.novelty import REACH, novelty_of
from graspsense.core.values.errors import ComponentFailed, ConfigError, counted
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.folds import Folds


class FitRefused(ConfigError):
    """A classifier refused the training trials of a fold: its `fit` raised ValueError."""


class ClassifierFactory(Protocol):
    """Makes untrained classifiers: a component with its config."""

    def create(self) -> Classifier[Any]:
        """Return a new, untrained classifier."""


Groups = Sequence["NDArray[np.int64]"]
"""Trials that are cross-validated separately: all of them, or those of each class."""


@frozen(eq=False)
class Pooled:
    """The predictions of all folds, one per trial.

    `probabilities` has shape (trials, classes), NaN for a class that is not among the labels of the group of the trial.
    """

    predicted: tuple[str, ...]
    classes: tuple[str, ...]
    probabilities: NDArray[np.float64]
    scores: NDArray[np.float64]
    """The scores from which prediction sets are made, of the same shape."""
    support: NDArray[np.float64]
    """The number of training trials that each answer rests on; NaN without such a number."""
    outside: NDArray[np.float64]
    """How far each trial is outside of those that the model of its fold learned from (`learn.novelty`)."""
    trained_on: float
    """Mean number of training trials per fold."""
    folds: int
    """The number of folds, 0 for the answers of a single model to other trials than its own."""

    @property
    def columns(self) -> NDArray[np.int64]:
        """The column of each predicted label."""
        return columns_of(self.predicted, self.classes)

    @property
    def unlike(self) -> NDArray[np.bool_]:
        """Which trials the model of their fold calls unknown."""
        return self.outside > REACH

    def right(self, labels: Sequence[str]) -> list[bool]:
        """Return whether each trial is predicted correctly."""
        return [answer == label for answer, label in zip(self.predicted, labels, strict=True)]


def refuse_without_features(table: FeatureTable) -> None:
    """Raise FitRefused if no trial has a feature."""
    if np.isnan(table.values).all():
        raise FitRefused(
            f"no feature is defined in any of the {counted(len(table), 'trial')}: there is nothing to learn from"
        )


def columns_of(labels: Sequence[str], classes: Sequence[str]) -> NDArray[np.int64]:
    """Return the column of each of these labels."""
    column = {name: k for k, name in enumerate(classes)}
    return np.array([column[label] for label in labels], dtype=np.int64)


def cross_validate(
    learner: ClassifierFactory,
    table: FeatureTable,
    labels: Sequence[str],
    groups: Groups,
    folds: Sequence[Folds],
    *,
    seed: int = 0,
    share: float = 1.0,
    progress: Callable[[], None] | None = None,
) -> Pooled:
    """Predict every trial of every group, with the folds of that group.

    `folds` has one array per group, of the length of the group. The prediction is the label with the largest
    probability, the first of several. If the training trials of a fold have a single label, that label is predicted.
    With `share`, training uses about that share of the training trials of each label, at least one. Raises FitRefused
    if the classifier cannot learn from the training trials of a fold.
    """
    refuse_without_features(table)
    predicted = [""] * len(labels)
    all_classes = tuple(sorted(set(labels)))
    probabilities = np.full((len(labels), len(all_classes)), np.nan)
    scores = probabilities.copy()
    outside = np.zeros(len(labels))
    support = np.full(len(labels), np.nan)
    sizes: list[int] = []
    for rows, fold_of in zip(groups, folds, strict=True):
        of_group = {labels[i] for i in rows}
        possible = np.flatnonzero([name in of_group for name in all_classes])
        probabilities[np.ix_(rows, possible)] = 0.0
        scores[np.ix_(rows, possible)] = 0.0
        for fold in range(int(fold_of.max()) + 1):
            test, training = rows[fold_of == fold], rows[fold_of != fold]
            if len(test) == 0:
                continue
            if share < 1.0:
                training = thinned(training, labels, share, seed)
            known = [labels[i] for i in training]
            classes, shares, support[test] = fit_and_predict(learner, table, training, known, test, seed)
            columns = np.array([all_classes.index(name) for name in classes])
            probabilities[np.ix_(test, columns)] = shares
            novelty = novelty_of(table.rows(training), known)
            tested = table.rows(test)
            scores[np.ix_(test, columns)] = scores_of(shares, novelty.closeness(tested, classes))
            outside[test] = novelty.outside(tested)
            for i, k in zip(test.tolist(), shares.argmax(axis=1).tolist(), strict=True):
                predicted[i] = classes[k]
            sizes.append(len(training))
            if progress is not None:
                progress()
    return Pooled(
        predicted=tuple(predicted),
        classes=all_classes,
        probabilities=probabilities,
        scores=scores,
        support=support,
        outside=outside,
        trained_on=float(np.mean(sizes)),
        folds=max(int(fold_of.max()) + 1 for fold_of in folds),
    )


def thinned(rows: NDArray[np.int64], labels: Sequence[str], share: float, seed: int) -> NDArray[np.int64]:
    """Return about this share of the trials of each label, at least one; a larger share contains a smaller one."""
    rng = np.random.default_rng(seed)
    known = np.array([labels[i] for i in rows])
    kept = []
    for label in np.unique(known):
        shuffled = rng.permutation(rows[known == label])
        kept.append(shuffled[: max(1, round(share * len(shuffled)))])
    return np.sort(np.concatenate(kept))


def fit_and_predict(
    learner: ClassifierFactory,
    table: FeatureTable,
    training: NDArray[np.int64],
    known: Sequence[str],
    test: NDArray[np.int64],
    seed: int,
) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64] | float]:
    """Return the classes, their probabilities for the test trials, and the support of the answers.

    `known` are the labels of the training trials. Raises FitRefused, and ComponentFailed for what are no probabilities.
    """
    if len(set(known)) == 1:
        return (known[0],), np.ones((len(test), 1)), nan
    classifier = learner.create()
    try:
        classifier.fit(table.rows(training), known, seed)
    except ValueError as error:
        raise FitRefused(
            f"the classifier refused {counted(len(known), 'training trial')} of "
            f"{counted(len(set(known)), 'label')}: {error}"
        ) from error
    tested = table.rows(test)
    support = classifier.support(tested)
    classes, shares = classifier.classes(), classifier.probabilities(tested)
    try:
        refuse_improbable(shares, len(test), len(classes))
        refuse_unsupported(support, len(test))
    except ValueError as error:
        name = f"{type(classifier).__module__}.{type(classifier).__qualname__}"
        raise ComponentFailed(
            f"the classifier {name} cannot be used: {error}. Correct it, or choose another"
        ) from error
    return classes, shares, nan if support is None else support
