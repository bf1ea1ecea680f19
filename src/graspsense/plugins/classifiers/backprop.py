"""Neural network with one hidden layer, trained as Weka's MultilayerPerceptron is by default."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final, Self

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import ClassifierConfig, setting
from graspsense.plugins.classifiers.scikit import ScikitClassifier
from graspsense.simulator_api import NotCompilable, compile_function, first_call

WEIGHT: Final = 0.05
"""The weights are uniformly distributed between minus and plus this number before the training."""


@frozen(kw_only=True)
class BackpropConfig(ClassifierConfig):
    """Settings of the network; the defaults are Weka's."""

    learning_rate: float = setting(
        default=0.3, above=0.0, maximum=1.0, meaning="Step along the gradient of one training trial."
    )
    momentum: float = setting(
        default=0.2,
        minimum=0.0,
        below=1.0,
        meaning="Share of the previous change that is added to each change.",
    )
    epochs: int = setting(
        default=500,
        minimum=1,
        maximum=100_000,
        meaning="Number of passes over the training trials.",
    )
    hidden: int = setting(
        default=0,
        minimum=0,
        maximum=10_000,
        meaning="Neurons of the hidden layer; 0: half the sum of the numbers of features and of labels.",
    )


class Backprop(ScikitClassifier[BackpropConfig]):
    """A network of sigmoid units, trained by gradient descent on the squared error of one trial at a time.

    As in Weka, the features have the range -1 to 1 over the training trials, the trials are shuffled once, and all
    epochs are run. The probabilities are the outputs divided by their sum.
    """

    shares_are = "outputs of the network"

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the untrained network."""
        return SigmoidNetwork(self.config, seed)

    def training_steps(self, trials: int, features: int, labels: int) -> float:
        """Return about how many steps of 10 ns the compiled training takes."""
        units = hidden_units(self.config, features, labels)
        return float(self.config.epochs) * trials * (200.0 + units * (features + labels) / 4.0)


class SigmoidNetwork:
    """The network with the methods of an estimator of scikit-learn."""

    classes_: NDArray[np.str_]

    def __init__(self, config: BackpropConfig, seed: int) -> None:
        self._config, self._seed = config, seed

    def fit(self, values: NDArray[np.float64], labels: NDArray[np.str_]) -> Self:
        """Train on these trials, shape (trials, features)."""
        rng, config = np.random.default_rng(self._seed), self._config
        self.classes_, numbers = np.unique(labels, return_inverse=True)
        self._low = values.min(axis=0)
        extent = values.max(axis=0) - self._low
        self._half = np.where(extent > 0.0, extent / 2.0, 1.0)
        order = rng.permutation(len(values))
        inputs = self._inputs(values)[order]
        wanted = np.eye(len(self.classes_))[numbers[order]]
        units = hidden_units(config, inputs.shape[1] - 1, len(self.classes_))
        start = [
            rng.uniform(-WEIGHT, WEIGHT, shape)
            for shape in ((units, inputs.shape[1]), (len(self.classes_), units + 1))
        ]
        rates = (config.learning_rate, config.momentum)
        self._hidden, self._output = _training()(inputs, wanted, start[0], start[1], rates, config.epochs)
        return self

    def predict_proba(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the outputs divided by their sum, shape (trials, classes)."""
        hidden = _sigmoid(self._inputs(values) @ self._hidden.T)
        outputs = _sigmoid(np.column_stack((hidden, np.ones(len(hidden)))) @ self._output.T)
        total = outputs.sum(axis=1, keepdims=True)
        # No output is above 0 where the network is sure that it is none of the labels.
        shares = np.where(total > 0.0, outputs / np.where(total > 0.0, total, 1.0), 1.0 / outputs.shape[1])
        return np.asarray(shares)

    def _inputs(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the features in the range -1 to 1 of the training trials, and a column of ones for the bias."""
        return np.column_stack(((values - self._low) / self._half - 1.0, np.ones(len(values))))


def _sigmoid(x: Any) -> Any:
    with np.errstate(over="ignore"):
        return 1.0 / (1.0 + np.exp(-x))


def hidden_units(config: BackpropConfig, features: int, labels: int) -> int:
    """Return the number of neurons of the hidden layer."""
    return config.hidden or (features + labels) // 2


@cache
def _training() -> Callable[..., Any]:
    """Return `train`, compiled if numba is installed, since the interpreter takes much longer."""
    try:
        compiled = compile_function(train)
    except NotCompilable:
        return train

    def run(*args: Any) -> Any:
        with first_call():
            return compiled(*args)

    return run


def train(
    inputs: NDArray[np.float64],
    wanted: NDArray[np.float64],
    hidden: NDArray[np.float64],
    output: NDArray[np.float64],
    rates: tuple[float, float],
    epochs: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the weights of both layers after the training.

    `inputs` has shape (trials, features + 1) with a last column of ones, `wanted` (trials, classes) with 0 and 1.
    `hidden` (units, features + 1) and `output` (classes, units + 1) are the weights before it, with those of the bias
    last. `rates` are the learning rate and the momentum (D. E. Rumelhart, G. E. Hinton and R. J. Williams, Nature 323
    (1986) 533).
    """
    rate, momentum = rates
    hidden_change, output_change = np.zeros_like(hidden), np.zeros_like(output)
    units = hidden.shape[0]
    felt = np.ones(units + 1)
    for _ in range(epochs):
        for i in range(inputs.shape[0]):
            felt[:units] = 1.0 / (1.0 + np.exp(-(hidden * inputs[i]).sum(axis=1)))
            answer = 1.0 / (1.0 + np.exp(-(output * felt).sum(axis=1)))
            error = (wanted[i] - answer) * answer * (1.0 - answer)
            back = (
                (output[:, :units] * error.reshape(-1, 1)).sum(axis=0) * felt[:units] * (1.0 - felt[:units])
            )
            output_change = rate * error.reshape(-1, 1) * felt + momentum * output_change
            hidden_change = rate * back.reshape(-1, 1) * inputs[i] + momentum * hidden_change
            output = output + output_change
            hidden = hidden + hidden_change
    return hidden, output
