"""The estimators of numbers: those of scikit-learn, which is imported when one is made.

Features (`core.learn.scaling`) and target are brought to mean 0 and standard deviation 1 over the training trials.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.caller import option
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.one_thread import one_thread
from graspsense.core.learn.scaling import mean_and_deviation, scaling_of
from graspsense.core.learn.target_value import TargetValue
from graspsense.core.values.errors import ConfigError, counted, suggestion
from graspsense.core.values.features import LARGEST_VALUE

DEFAULT_ESTIMATOR: Final = "forest"

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


def target_of(labelled: Labelled) -> TargetValue:
    """Return the numbers to predict. Raises ConfigError if there are none, or nothing to learn from them."""
    target = labelled.value
    if target is None:
        named = option("target_value", python="value")
        raise ConfigError(f"{labelled.source} has no number to predict: name it with {named}")
    # The squares of smaller differences can be 0.
    if not max(target.values) - min(target.values) >= 1.0 / LARGEST_VALUE:
        raise ConfigError(
            f"every trial of {labelled.source} has the same {target.name}, or nearly: there is nothing to predict"
        )
    return target


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
        from sklearn.preprocessing import StandardScaler

        check_estimator(name)
        if len(values) < 2:
            raise ValueError(f"{counted(len(values), 'trial')}: an estimator needs at least two")
        self._scaling = scaling_of(features, mean_and_deviation)
        self._estimator = TransformedTargetRegressor(
            regressor=_unfitted(name, seed, len(values)), transformer=StandardScaler()
        )
        with one_thread():
            self._estimator.fit(self._scaling.ready(features), values)

    def predict(self, features: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the predicted values, shape (trials,). A feature that is too far away counts as the farthest."""
        predicted = self._estimator.predict(self._scaling.ready(features))
        return np.asarray(predicted, dtype=np.float64).reshape(len(features))


def check_estimator(name: str) -> None:
    """Raise ConfigError if there is no estimator of this name."""
    if name not in ESTIMATORS:
        raise ConfigError(
            f"{name!r} cannot predict a number. Known: {', '.join(ESTIMATORS)}.{suggestion(name, list(ESTIMATORS))}"
        )
