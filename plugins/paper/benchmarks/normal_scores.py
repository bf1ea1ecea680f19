"""Proposals of ABC-SMC in normal scores, and the regression adjustment of a weighted sample."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pandas as pd
import pyabc
from pyabc.transition import Transition
from scipy.stats import multivariate_normal
from sklearn.linear_model import Ridge

FROM_PRIOR: Final = 0.1
"""Share of the proposals that are drawn from the prior, so that no weight exceeds 1 / this."""
WIDER: Final = 1.1
"""Factor on the variance of the last generation, whose tails are those of a small sample."""
OF_PRIOR: Final = 3.0
"""Weight of the prior in the moments, in particles for each parameter."""


class NormalScores(Transition):
    """Proposes parameters whose priors are all standard normal, independently of the particle that it starts from.

    The proposal is a normal distribution with the widened moments of the last generation, mixed with the prior. The
    moments are shrunk towards those of the prior, because those of a small sample of many parameters differ by chance,
    which makes the weights uneven. A kernel around each particle would do so too.
    """

    def fit(self, X: pd.DataFrame, w: np.ndarray) -> None:  # noqa: N803 (the name that pyABC gives it)
        """Take the moments of a weighted generation."""
        values = X.to_numpy(dtype=float)
        d, n = values.shape[1], 1.0 / float(np.square(w).sum())
        mean = w @ values
        cov = ((values - mean) * w[:, None]).T @ (values - mean)
        share = n / (n + OF_PRIOR * d)
        # A mean counts by its square over that of its error.
        mean = mean**3 / (mean**2 + 2.0 / n)
        self.proposal = multivariate_normal(mean, WIDER * (share * cov + (1.0 - share) * np.eye(d)))
        self.prior = multivariate_normal(np.zeros(d), np.eye(d))

    def rvs_single(self) -> pyabc.Parameter:
        """Return one proposal."""
        law = self.prior if np.random.random() < FROM_PRIOR else self.proposal  # noqa: NPY002 (as pyABC)
        return pyabc.Parameter(dict(zip(self.X.columns, np.atleast_1d(law.rvs()), strict=True)))

    def pdf(self, x: pyabc.Parameter | pd.Series | pd.DataFrame) -> Any:
        """Return the density of the proposal at one or more points."""
        columns = list(self.X.columns)
        if isinstance(x, pd.DataFrame):
            points = x[columns].to_numpy(dtype=float)
        else:
            points = np.array([x[name] for name in columns], dtype=float)
        return FROM_PRIOR * self.prior.pdf(points) + (1.0 - FROM_PRIOR) * self.proposal.pdf(points)


def adjusted(scores: Any, distances: Any, weights: Any) -> Any:
    """Return normal scores, shape (particles, figures), moved to where the distances from the data are zero.

    `distances` are simulated minus observed figures in standard deviations, shape (particles, statistics). The slope is
    that of a weighted linear ridge regression (Beaumont, Zhang and Balding 2002). The penalty is the prior of a slope
    with the standard deviation 1, for residuals with that of the scores.
    """
    slope = Ridge(alpha=1.0).fit(distances, scores, sample_weight=weights / np.mean(weights)).coef_
    return scores - distances @ np.atleast_2d(slope).T
