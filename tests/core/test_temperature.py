"""Calibrated probabilities: temperature scaling."""

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_conformal import bottles, model_of
from test_evaluate import judged

from graspsense.core.components.registry import installed
from graspsense.core.learn.certainty import MIN_TRIALS, TEMPERATURES, at_temperature, temperature_of
from graspsense.core.learn.model_file import load_model, write_model


def drawn(n, seed, sureness):
    """True probabilities of three labels to the power `sureness`, as one gives that is too sure, and drawn labels."""
    rng = np.random.default_rng(seed)
    true = rng.dirichlet((1.0, 1.0, 1.0), n)
    truth = np.array([rng.choice(3, p=p) for p in true])
    given = true**sureness
    return given / given.sum(axis=1, keepdims=True), truth, true


@every_case("sureness", [0.5, 1.0, 3.0])
def test_the_temperature_undoes_how_sure_a_classifier_is(sureness):
    given, truth, true = drawn(4000, 1, sureness)
    assert temperature_of(given, truth) == pytest.approx(sureness, rel=0.1)
    assert np.abs(at_temperature(given, sureness) - true).mean() < 5e-3


@given(
    arrays(np.float64, (5, 4), elements=st.floats(0.0, 1.0)).filter(lambda p: (p.max(axis=1) > 0.01).all()),
    st.floats(*TEMPERATURES),
)
def test_the_order_of_the_labels_stays_and_probabilities_sum_to_one(raw, temperature):
    given = raw / raw.sum(axis=1, keepdims=True)
    calibrated = at_temperature(given, temperature)
    assert calibrated.sum(axis=1) == pytest.approx(1.0)
    assert (np.diff(np.take_along_axis(calibrated, np.argsort(given), axis=1)) >= 0.0).all()


def test_a_label_that_is_not_possible_stays_so_and_few_trials_leave_the_probabilities_as_they_are():
    calibrated = at_temperature(np.array([[0.8, np.nan, 0.2]]), 2.0)
    assert np.isnan(calibrated[0, 1])
    assert calibrated[0, [0, 2]].tolist() == pytest.approx([2 / 3, 1 / 3])

    given, truth, _ = drawn(MIN_TRIALS - 1, 2, 3.0)
    assert temperature_of(given, truth) is None
    assert at_temperature(given, None) is given


def test_evaluate_measures_the_calibrated_probabilities_and_those_before():
    evaluation = judged(bottles(20, spread=1.2), "tree", controls=False)

    # A full-grown tree gives 100 % to every prediction, and a third of them are wrong.
    assert evaluation.reliability.uncalibrated_error > 0.1
    assert evaluation.reliability.calibration_error < 0.6 * evaluation.reliability.uncalibrated_error


def test_a_model_keeps_its_temperature_and_gives_calibrated_probabilities(tmp_path):
    trials = bottles(20, spread=1.2)
    model = model_of(trials, "tree")
    write_model(tmp_path / "m.json", model)
    loaded = load_model(str(tmp_path / "m.json"), installed())
    said, again = model.predict(trials.table.row(0)), loaded.predict(trials.table.row(0))

    assert loaded.temperature == model.temperature > 1.0
    assert again.probabilities == said.probabilities
    assert said.calibrated
    assert said.certainty == said.probabilities[said.label] < 0.9  # its leaf says 100 %
