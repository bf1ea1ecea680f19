"""Intervals of an identification."""

from __future__ import annotations

import numpy as np
import pytest

from graspsense_identify.interval import interval_of_mean, normal, student


def test_the_interval_of_a_mean_is_that_of_student() -> None:
    # t(2, 0.95) = 2.920, and the standard error of 1, 2, 3 is 1 / sqrt(3).
    low, high = interval_of_mean([1.0, 2.0, 3.0])
    assert (low + high) / 2.0 == pytest.approx(2.0)
    assert high - low == pytest.approx(2.0 * 2.91999 / np.sqrt(3.0), rel=1e-5)
    assert np.isnan(interval_of_mean([1.0])).all()
    assert normal() == pytest.approx(1.644854, rel=1e-6)
    assert student(10**6) == pytest.approx(normal(), rel=1e-5)
