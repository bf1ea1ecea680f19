"""Weighted samples, priors with their sources, and calibration."""

import numpy as np
import pytest

from graspsense_paper.inference import (
    Prior,
    contraction,
    effective_sample_size,
    rank_histogram,
    rank_of,
    uniformity_p,
    weighted_quantiles,
)

WIDE = Prior(name="a", unit="N", law="norm", args=(0.0, 2.0), origin="assumed", reason="a test")


def test_the_effective_sample_size_counts_equal_weights():
    assert effective_sample_size([2.0] * 7) == pytest.approx(7.0)
    assert effective_sample_size([1.0, 0.0, 0.0]) == pytest.approx(1.0)
    with pytest.raises(ValueError, match="all weights are zero"):
        effective_sample_size([0.0, 0.0])


def test_quantiles_follow_the_weights():
    values = [3.0, 1.0, 2.0]
    assert weighted_quantiles(values, [1.0, 1.0, 1.0], (0.0, 0.5, 1.0)) == (1.0, 2.0, 3.0)
    assert weighted_quantiles(values, [8.0, 1.0, 1.0], (0.1, 0.5)) == (1.0, 3.0)


def test_contraction_compares_with_the_prior():
    sample = np.random.default_rng(1).normal(0.5, 0.5, 4000)
    contracted = contraction(WIDE, sample, np.ones(4000))
    assert contracted.contraction == pytest.approx(1.0 - 0.25 / 4.0, abs=0.01)
    assert contracted.prior[2] == pytest.approx(3.92, abs=0.01)
    assert contracted.posterior[1] == pytest.approx(0.5, abs=0.05)


def test_a_prior_needs_a_source():
    with pytest.raises(ValueError, match="origin"):
        Prior(name="a", unit="", law="norm", args=(), origin="guess", reason="a test")
    with pytest.raises(ValueError, match="reason"):
        Prior(name="a", unit="", law="norm", args=(), origin="assumed", reason="")


@pytest.mark.parametrize(("width", "calibrated"), [(1.0, True), (0.4, False), (3.0, False)])
def test_calibration_detects_posteriors_that_are_too_narrow_or_too_wide(width, calibrated):
    # One observation with noise 1 of a parameter with prior N(0, 1): the posterior is N(y / 2, 1 / 2).
    rng = np.random.default_rng(2)
    ranks = []
    for _ in range(400):
        truth = rng.normal()
        observed = truth + rng.normal()
        sample = rng.normal(observed / 2.0, width * np.sqrt(0.5), 200)
        ranks.append(rank_of(truth, sample, np.ones(200)))
    assert (uniformity_p(rank_histogram(ranks)) > 0.01) is calibrated
