"""The estimators of numbers: those of scikit-learn, which is imported when one is made.

A missing feature is the median of the training trials. Features and target are brought to mean 0 and standard deviation
1 over the training trials.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspsense.core.learn.one_thread import one_thread
from graspsense.core.values.errors import ConfigError, counted, suggestion
from graspsense.core.values.features import LARGEST_VALUE

if TYPE_CHECKING:
    from numpy.typing import NDArray

DEFAULT_ESTIMATOR: Final = "forest"
MOST_SCALED: Final = 1e30
"""The largest scaled feature: trees compute with 32 bits, distances with squares."""


def _forest(seed: int, trials: int) -> Any:
    from sklearn.ensemble import RandomForestRegressor

    return RandomForestRegressor(n_estimators=100, random_state=seed)


def _knn(seed: int, trials: int) -> Any:
    from sklearn.neighbors import KNeighborsRegressor

    return KNeighborsRegressor(n_neighbors=min(5, trials))


def _mlp(seed: int, trials: int) -> Any:
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(hidden_layer_sizes=(20,), solver="lbfgs", alpha=0.01, max_iter=500, random_state=seed)


def _ridge(seed: int, trials: int) -> Any:
    from sklearn.linear_model import Ridge

    return Ridge(alpha=1.0)


def _svm(seed: int, trials: int) -> Any:
    from sklearn.svm import SVR

    return SVR(C=10.0)


def _tree(seed: int, trials: int) -> Any:
    from sklearn.tree import DecisionTreeRegressor

    return DecisionTreeRegressor(min_samples_leaf=2, random_state=seed)


ESTIMATORS: Final[Mapping[str, Callable[[int, int], Any]]] = {
    "forest": _forest,
    "knn": _knn,
    "mlp": _mlp,
    "ridge": _ridge,
    "svm": _svm,
    "tree": _tree,
}
"""Name to the function that makes the estimator from a seed and the number of training trials."""


class FittedRegression:
    """An estimator that is fitted to trials. The same trials and seed give the same estimator."""

    def __init__(
        self, name: str, features: NDArray[np.float64], values: NDArray[np.float64], seed: int
    ) -> None:
        """Fit the estimator of this name to features, shape (trials, features), and values, shape (trials,).

        Raises ConfigError for an unknown name, ValueError for fewer than two trials.
        """
        from sklearn.compose import TransformedTargetRegressor
        from sklearn.impute import SimpleImputer
        from sklearn.pipeline import make_pipeline
        from sklearn.preprocessing import StandardScaler

        check_estimator(name)
        if len(values) < 2:
            raise ValueError(f"{counted(len(values), 'trial')}: an estimator needs at least two")
        self._scaling = make_pipeline(
            SimpleImputer(strategy="median", keep_empty_features=True), StandardScaler()
        )
        self._estimator = TransformedTargetRegressor(
            regressor=ESTIMATORS[name](seed, len(values)), transformer=StandardScaler()
        )
        with one_thread():
            self._estimator.fit(self._scaling.fit_transform(features), values)

    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the predicted values, shape (trials,). A feature that is too far away counts as the farthest."""
        with np.errstate(over="ignore"):
            scaled = self._scaling.transform(np.clip(features, -LARGEST_VALUE, LARGEST_VALUE))
        scaled = np.clip(scaled, -MOST_SCALED, MOST_SCALED)
        return np.asarray(self._estimator.predict(scaled), dtype=np.float64).reshape(len(features))


def check_estimator(name: str) -> None:
    """Raise ConfigError if there is no estimator of this name."""
    if name not in ESTIMATORS:
        raise ConfigError(
            f"{name!r} cannot predict a number. Known: {', '.join(ESTIMATORS)}.{suggestion(name, list(ESTIMATORS))}"
        )
