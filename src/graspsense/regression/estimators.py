"""The estimators of numbers: those of scikit-learn, which is imported when one is made.

A missing feature is the median of the training trials. Features and target are brought to mean 0 and standard deviation
1 over the training trials.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.learn.one_thread import one_thread
from graspsense.core.values.errors import ConfigError, counted, suggestion
from graspsense.core.values.features import LARGEST_VALUE

DEFAULT_ESTIMATOR: Final = "forest"
MOST_SCALED: Final = 1e30
"""The largest scaled feature: trees compute with 32 bits, distances with squares."""


ESTIMATORS: Final[Mapping[str, tuple[str, Mapping[str, Any]]]] = {
    "forest": ("ensemble.RandomForestRegressor", {"n_estimators": 100}),
    "knn": ("neighbors.KNeighborsRegressor", {"n_neighbors": 5}),
    "mlp": (
        "neural_network.MLPRegressor",
        {"hidden_layer_sizes": (20,), "solver": "lbfgs", "alpha": 0.01, "max_iter": 500},
    ),
    "ridge": ("linear_model.Ridge", {"alpha": 1.0}),
    "svm": ("svm.SVR", {"C": 10.0}),
    "tree": ("tree.DecisionTreeRegressor", {"min_samples_leaf": 2}),
}
"""Name to the class in scikit-learn and its settings."""


def _unfitted(name: str, seed: int, trials: int) -> Any:
    """Return an estimator for so many training trials, which draws by this seed if it draws."""
    target, settings = ESTIMATORS[name]
    module, _, cls = target.rpartition(".")
    estimator = getattr(import_module(f"sklearn.{module}"), cls)(**settings)
    if "random_state" in estimator.get_params():
        estimator.set_params(random_state=seed)
    if "n_neighbors" in settings:
        estimator.set_params(n_neighbors=min(settings["n_neighbors"], trials))
    return estimator


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
            regressor=_unfitted(name, seed, len(values)), transformer=StandardScaler()
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
