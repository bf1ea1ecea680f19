"""Neural network with one hidden layer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from attrs import frozen

from graspsense.plugin_api import FeatureValue, Reason, setting
from graspsense.plugins.classifiers.scikit import FittedEstimator, KeptConfig, ScikitClassifier, most_likely

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

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


class Mlp(ScikitClassifier[MlpConfig]):
    """A network with one hidden layer, trained by L-BFGS, which suits hundreds of trials."""

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

    def reasons(
        self,
        fitted: FittedEstimator,
        row: NDArray[np.float64],
        given: Sequence[FeatureValue],
        shares: Mapping[str, float],
    ) -> Sequence[Reason]:
        """Return the contributions of the features to the probability, and the most probable labels."""
        return (
            *self.shapley_reasons(fitted, row, given, shares),
            most_likely(shares, "outputs of the network"),
        )
