"""The laws by themselves, against textbook values and the mathematics."""

import math

import numpy as np
import pytest

from graspsense_c45 import JavaRandom, criteria
from graspsense_c45.arithmetic import (
    TERM_BITS,
    WEIGHT_BITS,
    Scale,
    bits_below,
    ln,
    one_minus_exp,
    term,
    x_ln_x,
)
from graspsense_c45.building.cuts import rough_scale, rough_term
from graspsense_c45.estimates import estimated_errors, prepare_confidence


def test_logarithm_is_right_to_the_last_bits():
    rng = np.random.default_rng(1)
    for x in (rng.random(2_000) * 10.0 ** rng.uniform(-300, 300, 2_000)).tolist():
        assert ln(x) == pytest.approx(math.log(x), rel=4e-16, abs=2e-16)
    assert ln(1.0) == 0.0
    assert [x_ln_x(x) for x in (0.0, 5e-7, 1.0)] == [0.0, 0.0, 0.0]


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
    assert [estimated_errors(n, n, confidence) for n in (0.0, 3.0)] == [0.0, 3.0]
    assert estimated_errors(3.0, 1.0, prepare_confidence(0.6)) == 1.0
    for weight in np.linspace(1.0, 50.0, 500).tolist():
        assert weight * 0.3 <= estimated_errors(weight, weight * 0.3, confidence) <= weight + 1e-12


def test_rough_terms_are_far_closer_than_the_tolerance():
    rng = np.random.default_rng(4)
    for total in (3.0, 1e3, 1e9, 1e150):
        scale = Scale(bits_below(total, WEIGHT_BITS), bits_below(x_ln_x(total) + 1.0, TERM_BITS))
        tolerance = criteria.gain_tolerance(total, scale.term_bits)
        for weight in (1.0, *rng.uniform(1.0, total, 50)):
            units = round(math.ldexp(weight, scale.weight_bits))
            error = abs(rough_term(units, rough_scale(scale)) - term(units, scale)) if units else 0.0
            assert error < 1e-5 * tolerance


def test_java_random_is_javas():
    # Printed by Java 17: new Random(42).nextInt(100), five times; new Random(7).nextInt of powers of two.
    random = JavaRandom(42)
    assert [random.next_int(100) for _ in range(5)] == [30, 63, 48, 84, 70]
    assert [JavaRandom(7).next_int(2**k) for k in (1, 5, 30)] == [1, 23, 784582118]
    with pytest.raises(ValueError, match="bound"):
        random.next_int(0)
