"""Support vector machine with a radial or a linear kernel."""

from __future__ import annotations

from typing import Any, Final, Literal

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import setting
from graspsense.plugins.classifiers.scikit import FittedEstimator, KeptConfig, ScikitClassifier

MOST_ROUNDS: Final = 1_000_000
"""Largest number of steps of the solver: a large penalty needs some thousands; with a larger one it would not end."""


@frozen(kw_only=True)
class SvmConfig(KeptConfig):
    """Settings of the machine; the width of the radial kernel is `scale` of scikit-learn."""

    c: float = setting(
        default=10.0,
        above=0.0,
        maximum=1e9,
        meaning="Penalty of a training trial on the wrong side; a larger one fits the data more closely.",
    )
    kernel: Literal["rbf", "linear"] = setting(default="rbf", meaning="Radial or linear kernel.")
    scaling: Literal["deviation", "range"] = setting(
        default="deviation",
        meaning="deviation: features have mean 0 and standard deviation 1 in training. range: they have the range 0 to "
        "1, as in Weka's SMO.",
    )


class Svm(ScikitClassifier[SvmConfig]):
    """The probabilities are the softmax of the one-against-rest decision values, and are not calibrated."""

    shares_are = "softmax of the decision values"

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the machine."""
        from sklearn.svm import SVC

        return SVC(
            C=self.config.c,
            kernel=self.config.kernel,
            decision_function_shape="ovr",
            max_iter=MOST_ROUNDS,
            random_state=seed,
        )

    def origin_and_scale(
        self, values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return mean and standard deviation, or the least value and the range."""
        if self.config.scaling == "deviation":
            return super().origin_and_scale(values)
        low = values.min(axis=0)
        return low, values.max(axis=0) - low

    def shares(self, fitted: FittedEstimator, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the softmax of the decision values."""
        from scipy.special import softmax

        values = np.asarray(fitted.estimator.decision_function(rows), dtype=np.float64)
        if values.ndim == 1:  # two classes: one value, positive for the second
            values = np.column_stack((-values, values)) / 2.0
        return np.asarray(softmax(values, axis=1))
