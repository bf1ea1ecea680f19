"""The laws by themselves, against textbook values and the mathematics."""

import math

import numpy as np
import pytest

from graspsense_c45 import JavaRandom, criteria
from graspsense_c45.arithmetic import ln, one_minus_exp, x_ln_x
from graspsense_c45.estimates import estimated_errors, prepare_confidence
from graspsense_c45.nodewise.cuts import NOT_ADMISSIBLE, CutLimits, scan


def test_logarithm_is_right_to_the_last_bits():
    rng = np.random.default_rng(1)
    for x in (rng.random(2_000) * 10.0 ** rng.uniform(-300, 300, 2_000)).tolist():
        assert ln(x) == pytest.approx(math.log(x), rel=4e-16, abs=2e-16)
    assert ln(1.0) == 0.0
    assert x_ln_x(np.array([0.0, 5e-7, 1.0])).tolist() == [0.0, 0.0, 0.0]


def test_one_minus_exp_keeps_small_arguments():
    for y in (-1e-12, -1e-3, -0.5, -3.0, -40.0, -690.0):
        assert one_minus_exp(y) == pytest.approx(-math.expm1(y), rel=1e-14)
    assert one_minus_exp(-1e9) == 1.0


def test_estimates_are_quinlans():
    # C4.5 (1993), section 4.2: U_25%(0, 6) = 0.206, U(0, 9) = 0.143, U(0, 1) = 0.750, as rates.
    confidence = prepare_confidence(0.25)
    for errors, weight, rate in ((0, 6, 0.206), (0, 9, 0.143), (0, 1, 0.750), (1, 16, 0.157)):
        # The last one is interpolated in a table of z there, and exact here.
        expected = float(estimated_errors(float(weight), float(errors), confidence)) / weight
        assert expected == pytest.approx(rate, abs=6e-4 if errors == 0 else 4e-3)


def test_estimates_at_the_ends():
    confidence = prepare_confidence(0.25)
    assert estimated_errors(0.0, 0.0, confidence) == 0.0
    assert estimated_errors(3.0, 3.0, confidence) == 3.0
    assert estimated_errors(3.0, 1.0, prepare_confidence(0.6)) == 1.0
    weights = np.linspace(1.0, 50.0, 500)
    shares = estimated_errors(weights, weights * 0.3, confidence)
    assert ((shares >= weights * 0.3) & (shares <= weights + 1e-12)).all()


def test_least_side_weight_is_a_tenth_of_the_mean_class_within_bounds():
    assert criteria.min_side_weight(100.0, 4, 2.0) == pytest.approx(2.5)
    assert criteria.min_side_weight(100.0, 11, 2.0) == 2.0
    assert criteria.min_side_weight(5_000.0, 4, 2.0) == 25.0
    # Quinlan's bound of 25 gives way to a larger minimum.
    assert criteria.min_side_weight(5_000.0, 4, 200.0) == 200.0


def scanned(numerators, tolerance, least):
    best, taken = 0, -1
    for i, numerator in enumerate(numerators):
        if numerator != NOT_ADMISSIBLE and numerator - best > tolerance and numerator >= least:
            best, taken = numerator, i
    return taken


def test_best_cut_is_the_one_the_scan_ends_on():
    # Values close to each other compared with the tolerance, so that the first of several near-ties decides.
    rng = np.random.default_rng(3)
    for _ in range(300):
        shape = (int(rng.integers(1, 6)), int(rng.integers(1, 30)))
        numerators = np.cumsum(rng.integers(-3, 4, shape), axis=1) + rng.integers(-20, 20)
        numerators[rng.random(shape) < 0.2] = NOT_ADMISSIBLE
        tolerance, least = int(rng.integers(0, 7)), rng.integers(0, 7, shape[0])
        limits = CutLimits(np.zeros((shape[0], 1), np.int64), least, least, tolerance)
        best, place = np.zeros(shape[0], np.int64), np.full(shape[0], -1)
        scan(numerators, limits, best, place)
        for a, own in enumerate(numerators.tolist()):
            assert place[a] == scanned(own, tolerance, int(least[a]))
            assert best[a] == (own[place[a]] if place[a] >= 0 else 0)


def test_java_random_is_javas():
    # Printed by Java 17: new Random(42).nextInt(100), five times; new Random(7).nextInt of powers of two.
    random = JavaRandom(42)
    assert [random.next_int(100) for _ in range(5)] == [30, 63, 48, 84, 70]
    assert [JavaRandom(7).next_int(2**k) for k in (1, 5, 30)] == [1, 23, 784582118]
    with pytest.raises(ValueError, match="bound"):
        random.next_int(0)
