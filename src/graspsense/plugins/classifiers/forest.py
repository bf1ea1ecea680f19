"""Random forest, and extremely randomised trees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from attrs import frozen

from graspsense.classifier_api import Reason
from graspsense.plugin_api import setting
from graspsense.plugins.classifiers.scikit import ExplainedTrial, KeptConfig, ScikitClassifier
from graspsense.plugins.classifiers.tree_contributions import path_contributions


@frozen(kw_only=True)
class ForestConfig(KeptConfig):
    """Settings of the forest."""

    trees: int = setting(default=100, minimum=1, maximum=10_000, meaning="Number of trees.")
    min_leaf: int = setting(
        default=1, minimum=1, maximum=1_000_000_000, meaning="Smallest number of training trials at a leaf."
    )


class Forest(ScikitClassifier[ForestConfig]):
    """Decision trees on samples of the trials; the probabilities are means over the trees."""

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the forest."""
        from sklearn.ensemble import RandomForestClassifier

        return RandomForestClassifier(
            n_estimators=self.config.trees, min_samples_leaf=self.config.min_leaf, random_state=seed
        )

    def training_steps(self, trials: int, features: int, labels: int) -> float:
        """Return about how many steps of 10 ns the training takes."""
        return self.config.trees * (1e5 + trials * math.sqrt(features) * math.log2(trials + 1.0))

    def reasons(self, trial: ExplainedTrial) -> Sequence[Reason]:
        """Return the contributions of the features to the probability, and the mean of the trees."""
        column, trees = self.classes().index(trial.label), trial.fitted.estimator.estimators_
        means = []
        for tree in trees:
            values = tree.tree_.value[:, 0, :]
            means.append(values[:, column] / values.sum(axis=1))
        start, parts = path_contributions([tree.tree_ for tree in trees], means, trial.row)
        weights = np.array([start, *parts]) / len(trees)
        return (
            *trial.contributions(weights[1:].tolist(), float(weights[0])),
            trial.most_likely(f"mean of {len(trees)} trees"),
        )


class ExtraTrees(Forest):
    """Decision trees on all trials, whose thresholds are drawn at random; the probabilities are means over the trees.

    Source: P. Geurts, D. Ernst and L. Wehenkel, Machine Learning 63 (2006) 3.
    """

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the trees."""
        from sklearn.ensemble import ExtraTreesClassifier

        return ExtraTreesClassifier(
            n_estimators=self.config.trees, min_samples_leaf=self.config.min_leaf, random_state=seed
        )
