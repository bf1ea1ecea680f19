"""Gradient descent on one trial at a time, which numba compiles where it is installed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
