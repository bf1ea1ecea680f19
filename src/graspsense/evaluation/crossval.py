"""Cross validation: each trial is predicted once, by a model that was trained on the other folds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.roles import Classifier
from graspsense.core.learn.answers import Answers, answers_of
from graspsense.core.learn.model import refuse_improbable, refuse_unsupported
from graspsense.core.learn.novelty import novelty_of
from graspsense.core.values.errors import ComponentFailed, ConfigError, counted
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.folds import Folds, splits


class FitRefused(ConfigError):
    """A classifier refused the training trials of a fold: its `fit` raised ValueError."""


class ClassifierFactory(Protocol):
    """Makes untrained classifiers: a component with its config."""

    def create(self) -> Classifier[Any]:
        """Return a new, untrained classifier."""


def refuse_without_features(table: FeatureTable) -> None:
    """Raise FitRefused if no trial has a feature."""
    if np.isnan(table.values).all():
        raise FitRefused(
            f"no feature is defined in any of the {counted(len(table), 'trial')}: there is nothing to learn from"
        )


def cross_validate(
    learner: ClassifierFactory,
    table: FeatureTable,
    labels: Sequence[str],
    folds: Folds,
    within: NDArray[np.int64] | None = None,
    *,
    seed: int = 0,
    share: float = 1.0,
    progress: Callable[[], None] | None = None,
) -> Answers:
    """Predict the trials of every fold, as `splits` divides them, by models of the other folds.

    The prediction is the label with the largest probability, the first of several. If the training trials of a fold
    have a single label, that label is predicted. A trial without a fold has no probabilities. With `share`, training
    uses about that share of the training trials of each label, at least one. Raises FitRefused if the classifier cannot
    learn from the training trials of a fold.
    """
    refuse_without_features(table)
    n, all_classes = len(labels), tuple(sorted(set(labels)))
    probabilities, scores = np.full((2, n, len(all_classes)), np.nan)
    outside, support, predicted = np.zeros(n), np.full(n, np.nan), np.zeros(n, dtype=np.int64)
    sizes: list[int] = []
    for test, training in splits(folds, within):
        possible = {labels[i] for i in (*test, *training)}
        columns = np.flatnonzero([name in possible for name in all_classes])
        probabilities[np.ix_(test, columns)] = scores[np.ix_(test, columns)] = 0.0
        if share < 1.0:
            training = thinned(training, labels, share, seed)
        known = [labels[i] for i in training]
        classes, shares, support[test] = fit_and_predict(learner, table, training, known, test, seed)
        columns = np.array([all_classes.index(name) for name in classes])
        answers = answers_of(
            novelty_of(table.rows(training), known),
            table.rows(test),
            classes,
            shares,
            columns[shares.argmax(axis=1)],
            support[test],
        )
        probabilities[np.ix_(test, columns)], scores[np.ix_(test, columns)] = shares, answers.scores
        outside[test], predicted[test] = answers.outside, answers.columns
        sizes.append(len(training))
        if progress is not None:
            progress()
    groups = [folds] if within is None else [folds[within == number] for number in np.unique(within)]
    return Answers(
        classes=all_classes,
        probabilities=probabilities,
        scores=scores,
        columns=predicted,
        support=support,
        outside=outside,
        folds=max(len(np.unique(of_group[of_group >= 0])) for of_group in groups),
        trained_on=float(np.mean(sizes)),
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
