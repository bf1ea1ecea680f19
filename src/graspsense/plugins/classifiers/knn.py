"""Nearest neighbours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.classifier_api import Reason
from graspsense.plugin_api import ClassifierConfig, setting
from graspsense.plugins.classifiers.scikit import ExplainedTrial, FittedEstimator, ScikitClassifier


@frozen(kw_only=True)
class KnnConfig(ClassifierConfig):
    """Settings of the vote."""

    neighbours: int = setting(
        default=5,
        minimum=1,
        plausible=(1, 10_000),
        meaning="Number of training trials that vote; fewer if there are fewer.",
    )


class Knn(ScikitClassifier[KnnConfig]):
    """A vote of the nearest training trials, with distances in standard deviations of the training trials."""

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the vote."""
        from sklearn.neighbors import KNeighborsClassifier

        return KNeighborsClassifier(n_neighbors=min(self.config.neighbours, trials))

    def reasons(self, trial: ExplainedTrial) -> Sequence[Reason]:
        """Return the contributions of the features to the share of votes, the votes, and the nearest distance."""
        distances, _ = trial.fitted.estimator.kneighbors(trial.row)
        for_label, votes = self.counted(trial.fitted, trial.row)
        words = (
            f"{for_label:.0f} of the {votes:.0f} nearest training trials are {trial.label}; the nearest is "
            f"{distances[0, 0]:.2g} standard deviations away"
        )
        return (*self.shapley_reasons(trial), Reason(words=words))

    def counted(self, fitted: FittedEstimator, row: NDArray[np.float64]) -> tuple[float, float]:
        """Return the votes for the label, and all votes."""
        _, rows = fitted.estimator.kneighbors(row)
        votes = [fitted.labels[i] for i in rows[0].tolist()]
        return float(max(votes.count(vote) for vote in votes)), float(len(votes))
