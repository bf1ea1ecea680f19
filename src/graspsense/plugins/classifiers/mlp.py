"""Neural network with one hidden layer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Literal

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import StoredValues, setting
from graspsense.plugins.classifiers.scikit import (
    FittedEstimator,
    KeptConfig,
    ScikitClassifier,
    restored,
)

MOST_ROUNDS: Final = 500
"""Largest number of rounds of L-BFGS."""


@frozen(kw_only=True)
class MlpConfig(KeptConfig):
    """Settings of the network."""

    hidden: int = setting(
        default=20,
        minimum=1,
        maximum=10_000,
        meaning="Neurons of the hidden layer.",
    )
    weight_decay: float = setting(
        default=0.01, minimum=0.0, maximum=1e6, meaning="L2 penalty on the weights."
    )
    kept_as: Literal["trials", "weights", "skops"] = setting(  # type: ignore[assignment]
        default="trials",
        meaning="What a model file holds: the training trials, the weights, or the fitted estimator (extra skops).",
    )


class Mlp(ScikitClassifier[MlpConfig]):
    """A network with one hidden layer, trained by L-BFGS, which suits hundreds of trials."""

    shares_are = "outputs of the network"

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the network."""
        from sklearn.neural_network import MLPClassifier

        return MLPClassifier(
            hidden_layer_sizes=(self.config.hidden,),
            alpha=self.config.weight_decay,
            solver="lbfgs",
            max_iter=MOST_ROUNDS,
            random_state=seed,
        )

    def training_steps(self, trials: int, features: int, labels: int) -> float:
        """Return about how many steps of 10 ns the training takes; of products of matrices, ten are one."""
        return MOST_ROUNDS * (1e4 + trials * self.config.hidden * (features + labels) / 10.0)

    def shares(self, fitted: FittedEstimator, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the probabilities of preprocessed trials; they are not finite if the weights are too large."""
        with np.errstate(over="ignore", invalid="ignore"):
            return super().shares(fitted, rows)

    def estimator_as_json(self, estimator: Any) -> dict[str, Any]:
        """Return the weights, or what the setting `kept_as` asks for."""
        if self.config.kept_as != "weights":
            return super().estimator_as_json(estimator)
        return {
            "classes": list(self.classes()),
            "weights": [layer.tolist() for layer in estimator.coefs_],
            "offsets": [layer.tolist() for layer in estimator.intercepts_],
        }

    def from_json(self, model: Mapping[str, Any]) -> None:
        """Restore the network, without training it if the weights were kept. Raises DataDamaged or ValueError."""
        if "weights" not in model:
            super().from_json(model)
            return
        stored = StoredValues(model)
        names, units = stored.features("features")
        classes = stored.texts("classes", distinct=True)
        outputs = 1 if len(classes) == 2 else len(classes)
        shapes = [(len(names), self.config.hidden), (self.config.hidden, outputs)]
        layers = StoredValues({str(k): layer for k, layer in enumerate(stored.items("weights"))}, "weights")
        offsets = StoredValues({str(k): layer for k, layer in enumerate(stored.items("offsets"))}, "offsets")
        estimator = self.estimator(0, 2)
        estimator.coefs_ = [layers.numbers(str(k), shape) for k, shape in enumerate(shapes)]
        estimator.intercepts_ = [offsets.numbers(str(k), shape[1:]) for k, shape in enumerate(shapes)]
        estimator.classes_ = np.array(classes)
        estimator.n_layers_, estimator.n_outputs_ = len(shapes) + 1, outputs
        estimator.n_features_in_ = len(names)
        estimator.out_activation_ = "logistic" if outputs == 1 else "softmax"
        self._made_with, self._fitted = "", restored(stored, names, units, estimator)
