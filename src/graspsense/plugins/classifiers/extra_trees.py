"""Extremely randomised trees."""

from __future__ import annotations

from typing import Any

from graspsense.plugins.classifiers.forest import Forest


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
