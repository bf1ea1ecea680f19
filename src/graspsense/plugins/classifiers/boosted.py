"""Gradient-boosted trees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.classifier_api import Reason
from graspsense.plugin_api import ClassifierConfig, setting
from graspsense.plugins.classifiers.scikit import ExplainedTrial, ScikitClassifier
from graspsense.plugins.classifiers.tree_contributions import means_from_leaves, path_contributions


@frozen(kw_only=True)
class BoostedConfig(ClassifierConfig):
    """Settings of the boosting."""

    stages: int = setting(default=100, minimum=1, maximum=10_000, meaning="Trees of each label.")
    learning_rate: float = setting(
        default=0.1, above=0.0, maximum=10.0, plausible=(0.001, 1.0), meaning="Factor of each tree's output."
    )
    depth: int = setting(default=3, minimum=1, maximum=30, meaning="Largest number of tests on a path.")
    min_leaf: int = setting(
        default=1, minimum=1, maximum=1_000_000_000, meaning="Smallest number of training trials at a leaf."
    )
    sample: float = setting(
        default=1.0, above=0.0, maximum=1.0, meaning="Share of the training trials, drawn anew for each tree."
    )


class Boosted(ScikitClassifier[BoostedConfig]):
    """Trees of which each corrects the sum of those before it, in the log-odds of the labels."""

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the boosting. Its trees are public, unlike those of the histogram-based one of scikit-learn."""
        from sklearn.ensemble import GradientBoostingClassifier

        return GradientBoostingClassifier(
            n_estimators=self.config.stages,
            learning_rate=self.config.learning_rate,
            max_depth=self.config.depth,
            min_samples_leaf=self.config.min_leaf,
            subsample=self.config.sample,
            random_state=seed,
        )

    def training_steps(self, trials: int, features: int, labels: int) -> float:
        """Return about how many steps of 10 ns the training takes."""
        trees = self.config.stages * (labels if labels > 2 else 1)
        return trees * (1e5 + trials * features * min(self.config.depth, math.log2(trials + 1.0)))

    def reasons(self, trial: ExplainedTrial) -> Sequence[Reason]:
        """Return the contributions of the features to the odds of the label against the next most probable one."""
        label, against = list(trial.shares)[:2]
        (output, parts), (other, others) = (self._output(trial, name) for name in (label, against))
        each = parts - others
        return (
            *trial.contributions(each.tolist(), output - other - float(each.sum()), "log-odds", against),
            trial.most_likely(f"sum of {len(trial.fitted.estimator.estimators_)} trees of each label"),
        )

    def _output(self, trial: ExplainedTrial, label: str) -> tuple[float, NDArray[np.float64]]:
        """Return the output for a label before the softmax, and the contribution of each feature to it.

        Of two labels, the second has an output, the log-odds, and that of the first is 0.
        """
        estimator, column = trial.fitted.estimator, self.classes().index(label)
        if len(self.classes()) == 2:
            if column == 0:
                return 0.0, np.zeros(trial.row.shape[1])
            column = 0
        trees = [stage[column].tree_ for stage in estimator.estimators_]
        _, parts = path_contributions(trees, [means_from_leaves(tree) for tree in trees], trial.row)
        output = estimator.decision_function(trial.row).reshape(-1)[column]
        return float(output), estimator.learning_rate * np.array(parts)
