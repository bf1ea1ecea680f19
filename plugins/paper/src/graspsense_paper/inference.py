"""Simulation-based inference: priors, weighted samples of a posterior, and checks of an inference.

The calibration is that of S. Talts, M. Betancourt, D. Simpson, A. Vehtari and A. Gelman, "Validating Bayesian Inference
Algorithms with Simulation-Based Calibration" (2018): true values are drawn from the prior and data from the model. The
rank of each true value within its posterior sample is then uniformly distributed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from attrs import field, frozen
from attrs.validators import in_, min_len

from graspsense.experiment_api import ORIGINS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray


@frozen(kw_only=True)
class Prior:
    """The prior distribution of one parameter, with its source.

    `law` is the name of a distribution of `scipy.stats`, and `args` are its arguments: `uniform` has the lower limit
    and the width, `loguniform` both limits, `truncnorm` both limits in standard deviations from the mean, the mean and
    the standard deviation.
    """

    name: str
    unit: str
    law: str
    args: tuple[float, ...]
    origin: str = field(validator=in_(ORIGINS))
    """Where it comes from: nothing that the inference is conditioned on."""
    reason: str = field(validator=min_len(1))

    def distribution(self) -> Any:
        """Return the frozen distribution. Raises AttributeError if `scipy.stats` has none of this name."""
        import scipy.stats

        return getattr(scipy.stats, self.law)(*self.args)


@frozen(kw_only=True)
class Contraction:
    """A parameter before and after: 95 % intervals, medians, and the loss of variance.

    `contraction` is 1 - var(posterior) / var(prior): 1 if the data determine the parameter, 0 if they say nothing. It
    is negative if the posterior is wider than the prior.
    """

    prior: tuple[float, float, float]
    """2.5, 50 and 97.5 % quantiles."""
    posterior: tuple[float, float, float]
    contraction: float


def effective_sample_size(weights: ArrayLike) -> float:
    """Return Kish's effective sample size, (sum w)^2 / sum w^2. Raises ValueError if all weights are zero."""
    import numpy as np

    w = np.asarray(weights, dtype=np.float64)
    if not np.any(w > 0.0):
        raise ValueError("all weights are zero: there is no sample")
    return float(w.sum() ** 2 / np.square(w).sum())


def weighted_quantiles(values: ArrayLike, weights: ArrayLike, levels: Sequence[float]) -> tuple[float, ...]:
    """Return the smallest values with at least these shares of the weight at or below them."""
    import numpy as np

    v, w = np.asarray(values, dtype=np.float64), np.asarray(weights, dtype=np.float64)
    order = np.argsort(v, kind="stable")
    share = np.cumsum(w[order]) / w.sum()
    places = np.searchsorted(share, np.asarray(levels) - 1e-12)
    return tuple(float(v[order[min(int(i), len(v) - 1)]]) for i in places)


def contraction(prior: Prior, values: ArrayLike, weights: ArrayLike) -> Contraction:
    """Return how far a weighted posterior sample is narrower than its prior."""
    import numpy as np

    v, w = np.asarray(values, dtype=np.float64), np.asarray(weights, dtype=np.float64)
    w = w / w.sum()
    law, levels = prior.distribution(), (0.025, 0.5, 0.975)
    mean = np.average(v, weights=w)
    # Without bias also for few effective particles (variance of a sample with reliability weights).
    variance = float(np.average((v - mean) ** 2, weights=w)) / max(1.0 - float(np.square(w).sum()), 1e-12)
    low, middle, high = weighted_quantiles(v, w, levels)
    prior_quantiles = [float(law.ppf(level)) for level in levels]
    return Contraction(
        prior=(prior_quantiles[0], prior_quantiles[1], prior_quantiles[2]),
        posterior=(low, middle, high),
        contraction=1.0 - variance / float(law.var()),
    )


def rank_of(truth: float, values: ArrayLike, weights: ArrayLike) -> float:
    """Return the share of the weight below the true value, half of that at it included: 0 to 1."""
    import numpy as np

    v, w = np.asarray(values, dtype=np.float64), np.asarray(weights, dtype=np.float64)
    return float((w[v < truth].sum() + 0.5 * w[v == truth].sum()) / w.sum())


def rank_histogram(ranks: ArrayLike, bins: int = 10) -> NDArray[np.int64]:
    """Return the number of ranks (0 to 1) in each of `bins` equal parts."""
    import numpy as np

    return np.histogram(np.asarray(ranks, dtype=np.float64), bins=bins, range=(0.0, 1.0))[0].astype(np.int64)


def uniformity_p(histogram: ArrayLike) -> float:
    """Return the p-value of Pearson's chi-square test that all parts of a rank histogram are equally probable."""
    import numpy as np
    from scipy.stats import chisquare

    return float(chisquare(np.asarray(histogram, dtype=np.float64)).pvalue)
