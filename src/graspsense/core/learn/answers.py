"""Answers of models to trials, before calibration: the table from which all that is said of certainty is computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.core.learn.novelty import REACH, Novelty

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.values.features import FeatureTable

_CLOSENESS: Final = 1e-3
"""Weight of the closeness in a score: it only matters among probabilities that are equal, or almost."""


@frozen(kw_only=True, eq=False)
class Answers:
    """The answers to some trials, one a row.

    `probabilities` and `scores` (`learn.conformal`) have shape (trials, classes), NaN for a label that is not possible.
    `columns` has the column of each predicted label, `support` the number of training trials that it rests on (NaN
    without such a number), and `outside` how far the trial is outside of those that were learned from
    (`learn.novelty`). `folds` is the number of models that shared training trials, 0 for a single model that learned
    from none of these trials; `trained_on` is the mean number of training trials.
    """

    classes: tuple[str, ...]
    probabilities: NDArray[np.float64]
    scores: NDArray[np.float64]
    columns: NDArray[np.int64]
    support: NDArray[np.float64]
    outside: NDArray[np.float64]
    folds: int = 0
    trained_on: float = 0.0

    @property
    def predicted(self) -> tuple[str, ...]:
        """The predicted labels."""
        return tuple(self.classes[k] for k in self.columns.tolist())

    @property
    def shares(self) -> NDArray[np.float64]:
        """The probability of each predicted label."""
        return self.probabilities[np.arange(len(self.columns)), self.columns]

    @property
    def unlike(self) -> NDArray[np.bool_]:
        """Which trials the model calls unknown."""
        return self.outside > REACH

    def right(self, labels: Sequence[str]) -> list[bool]:
        """Return whether each trial, with these labels, is predicted correctly."""
        return [answer == label for answer, label in zip(self.predicted, labels, strict=True)]

    def columns_of(self, labels: Sequence[str]) -> NDArray[np.int64]:
        """Return the column of each of these labels."""
        return np.array([self.classes.index(label) for label in labels], dtype=np.int64)

    def known(self, labels: Sequence[str]) -> NDArray[np.bool_]:
        """Return which trials, with these labels, have one that their model learned; only others have no score."""
        return self.scores[np.arange(len(labels)), self.columns_of(labels)] > 0.0

    def rows(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> Answers:
        """Return the answers to these trials."""
        return evolve(
            self,
            probabilities=self.probabilities[which],
            scores=self.scores[which],
            columns=self.columns[which],
            support=self.support[which],
            outside=self.outside[which],
        )


def answers_of(
    novelty: Novelty,
    table: FeatureTable,
    classes: tuple[str, ...],
    probabilities: NDArray[np.float64],
    columns: NDArray[np.int64],
    support: NDArray[np.float64],
) -> Answers:
    """Return the answers of a model to the trials of a table; `novelty` are the ranges that it learned from.

    Of labels that are equally probable, that one has the larger score whose training trials lie closer.
    """
    return Answers(
        classes=classes,
        probabilities=probabilities,
        scores=probabilities + _CLOSENESS * novelty.closeness(table, classes),
        columns=columns,
        support=support,
        outside=novelty.outside(table),
    )
