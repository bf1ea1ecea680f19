"""Calibrated probabilities: the certainty of the answer, and what remains for the other labels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_conformal import bottles
from test_evaluate import judged

from graspsense.core.learn.certainty import with_certainty


@given(arrays(np.float64, (5, 4), elements=st.floats(0.0, 1.0)), st.floats(0.25, 1.0))
def test_the_order_of_the_labels_stays_and_probabilities_sum_to_one(raw, sure):
    given = raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-9)
    calibrated = with_certainty(given, given.argmax(axis=1), np.full(5, sure))
    assert calibrated.sum(axis=1) == pytest.approx(1.0)
    assert calibrated[np.arange(5), given.argmax(axis=1)] == pytest.approx(sure)
    apart, calibrated_apart = (p[:, :, np.newaxis] - p[:, np.newaxis, :] for p in (given, calibrated))
    assert (apart * calibrated_apart >= -1e-9).all()


def test_a_label_without_a_training_trial_close_by_is_less_likely_and_one_that_is_not_possible_stays_so():
    shares = with_certainty(np.array([[0.8, np.nan, 0.2, 0.0]]), np.array([0]), np.array([0.7]))[0]
    assert np.isnan(shares[1])
    assert 0.0 < shares[3] < 0.02 < 0.28 < shares[2]


def test_evaluate_measures_the_calibrated_probabilities_and_those_before():
    judgements = [
        judged(bottles(20, spread=spread), "tree", controls=False) for spread in (0.9, 1.2, 1.5, 2.0)
    ]
    uncalibrated = np.mean([evaluation.reliability.uncalibrated_error for evaluation in judgements])

    # A full-grown tree gives 100 % to every prediction, and a third of them are wrong. One set of trials has luck.
    assert uncalibrated > 0.1
    assert (
        np.mean([evaluation.reliability.calibration_error for evaluation in judgements]) < 0.6 * uncalibrated
    )
