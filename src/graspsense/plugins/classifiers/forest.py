"""Random forest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from attrs import field, frozen
from attrs.validators import ge, instance_of

from graspsense.plugins.classifiers.scikit import FittedEstimator, KeptConfig, ScikitClassifier, most_likely

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@frozen(kw_only=True)
class ForestConfig(KeptConfig):
    """Settings of the forest."""

    trees: int = field(default=100, validator=[instance_of(int), ge(1)])
    min_leaf: int = field(default=1, validator=[instance_of(int), ge(1)])
    """Smallest number of training trials at a leaf."""


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
