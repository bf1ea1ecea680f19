"""Random forest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from attrs import frozen

from graspsense.plugin_api import setting
from graspsense.plugins.classifiers.scikit import FittedEstimator, KeptConfig, ScikitClassifier, most_likely

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@frozen(kw_only=True)
class ForestConfig(KeptConfig):
    """Settings of the forest."""

    trees: int = setting(default=100, minimum=1, plausible=(1, 100_000), meaning="Number of trees.")
    min_leaf: int = setting(default=1, minimum=1, meaning="Smallest number of training trials at a leaf.")


class Forest(ScikitClassifier[ForestConfig]):
    """Decision trees on samples of the trials; the probabilities are means over the trees."""

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the forest."""
        from sklearn.ensemble import RandomForestClassifier

        return RandomForestClassifier(
            n_estimators=self.config.trees, min_samples_leaf=self.config.min_leaf, random_state=seed
        )

    def reasons(self, fitted: FittedEstimator, row: NDArray[np.float64], label: str) -> Sequence[str]:
        """Return the votes of the trees."""
        what = f"mean of {self.config.trees} trees"
        return (most_likely(self.shares(fitted, row)[0].tolist(), self.classes(), what),)
