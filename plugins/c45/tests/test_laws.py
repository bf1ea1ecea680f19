"""The laws by themselves, against textbook values and the mathematics."""

import itertools
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
from graspsense_c45.building.cuts import Limits, Run, rough_scale, rough_term, scan_unit, scan_weighted
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


def best_place(numerators, limits):
    best, taken = 0, -1
    for i, numerator in numerators.items():
        if numerator - best > limits.tolerance and numerator >= limits.least_numerator:
            best, taken = numerator, i
    return taken, best


def numerator_of(left, right, scale):
    """Of the gain of a cut (see `criteria.gain`), from the weights of the classes on its sides."""
    sides = sum(term(weight, scale) for weight in (*left, *right)) - term(sum(left), scale)
    whole = [sum(pair) for pair in zip(left, right, strict=True)]
    undivided = term(sum(whole), scale) - sum(term(weight, scale) for weight in whole)
    return undivided + sides - term(sum(right), scale)


def test_best_cut_is_the_first_of_those_within_the_tolerance():
    # Tolerances of the size of the differences, so that the first of several near-ties decides.
    rng, scale = np.random.default_rng(3), Scale(0, 40)
    for _ in range(300):
        n, n_classes = int(rng.integers(2, 30)), int(rng.integers(1, 5))
        values, labels = sorted(rng.integers(0, 12, n).tolist()), rng.integers(0, n_classes, n).tolist()
        rows, weights = rng.permutation(n).tolist(), [1] * n
        limits = Limits(True, int(rng.integers(1, 4)), *map(int, rng.integers(0, 2**40, 2)))
        by_class = [[w * (labels[row] == k) for k in range(n_classes)] for row, w in enumerate(weights)]
        numerators = {}
        for i in range(n - 1):
            left, right = (
                [sum(column) for column in zip(*(by_class[row] for row in side), strict=True)]
                for side in (rows[: i + 1], rows[i + 1 :])
            )
            if min(sum(left), sum(right)) >= limits.least_weight and values[i] < values[i + 1]:
                numerators[i] = numerator_of(left, right, scale)
        counts = [labels.count(k) for k in range(n_classes)]
        run = Run(rows, values, 0, n, labels, counts, [0] * n_classes)
        terms = [term(number, scale) for number in range(n + 1)]
        steps = [high - low for low, high in itertools.pairwise(terms)]
        for cut in (
            scan_unit(run, terms, steps, limits),
            scan_weighted(run, weights, [0] * n_classes, scale, limits),
        ):
            assert (cut.place, cut.numerator) == best_place(numerators, limits)
            assert cut.n_cuts == len(numerators)


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
