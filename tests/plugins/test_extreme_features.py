"""Features of any size: an answer with probabilities, or a refusal that names the feature; no warning, no bug."""

import math
import warnings

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import answered, graspsense, printed
from test_classifiers import NAMES, UNITS
from test_damaged_models import KINDS, labelled, trained

from graspsense.core.learn.target_value import TargetValue
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.features import UNKNOWN, FeatureTable
from graspsense.regression.estimators import ESTIMATORS
from graspsense.regression.model import train_regression

FEW = ["c45", "svm", "knn"]


EVERY = [*FEW, *(pytest.param(name, marks=pytest.mark.slow) for name in KINDS if name not in FEW)]
EXTREMES = (1e308, -1e308, 1.7e308, 1e154, 1e39, 5e-324, -5e-324, 0.0)
pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def table_of(rows):
    return FeatureTable(names=NAMES, units=UNITS, values=np.array(rows))


@pytest.mark.parametrize("name", EVERY)
def test_a_trial_of_extreme_features_has_probabilities_and_is_unknown_where_it_is_far_away(name):
    model = trained(name)
    table = table_of([[value, 8.0, 0.0] for value in EXTREMES] + [[value] * 3 for value in EXTREMES])
    answers = model.answers(table)
    shares = answers.probabilities
    assert shares.sum(axis=1) == pytest.approx(np.ones(len(table)))
    model.predictions(table)
    for i in range(len(table)):
        prediction = model.predict(table.row(i))
        assert prediction.label == UNKNOWN  # each first feature is far from every bottle and can
        assert sum(prediction.probabilities.values()) == pytest.approx(1.0)
        assert answers.unlike[i]
        assert "unlike everything" in prediction.because[0].words
        assert model.classifier.explain(table.row(i)).because


@every_case("value", [1e308, -1e308, math.inf, 1e101])
def test_features_too_large_to_learn_from_are_refused_by_name(value):
    given = labelled()
    values = given.table.values.copy()
    values[3, 1] = value
    with pytest.raises(DataDamaged, match=r"'f_steady' of trial 4 is"):
        evolve(given, table=evolve(given.table, values=values))


def test_a_number_too_large_to_predict_is_refused_by_name():
    with pytest.raises(DataDamaged, match=r"'force' of trial 2 is 1e\+308"):
        evolve(labelled(1), value=TargetValue(name="force", unit="N", values=(1.0, 1e308, 2.0)))


@pytest.fixture
def table(tmp_path):
    """Return a function that writes a table to learn from, with one extreme cell."""
    rng = np.random.default_rng(0)
    rows = [[i % 2 + 0.1 * rng.normal(), rng.normal()] for i in range(24)]

    def table(cell):
        rows[6] = [cell, 0.5]
        lines = [f"{'ab'[i % 2]},{width},{force_n}" for i, (width, force_n) in enumerate(rows)]
        path = tmp_path / f"{cell}.csv"
        path.write_text("\n".join(["what,width [m],force [N]", *lines, ""]))
        return path

    return table


@pytest.mark.parametrize("name", ["c45", pytest.param("svm", marks=pytest.mark.slow)])
def test_commands_answer_or_name_the_column(table, tmp_path, name):
    model = tmp_path / "m.json"
    train = ("train", "--label", "what", "--classifier", name, "--overwrite", "--out", model)
    for cell in ("1e308", "-1e308", "inf", "1e400", "-inf"):
        for command in (train, ("evaluate", "--label", "what", "--classifier", name)):
            code, _, err = graspsense(*command, table(cell))
            assert (code, "width" in err) == (5, True)
    printed(*train, table("5e-324"))
    for cell in ("1e308", "-1e308"):
        said = answered("predict", model, table(cell))["predictions"][6]
        assert (said["label"], sum(said["probabilities"].values())) == (UNKNOWN, pytest.approx(1.0))
    assert graspsense("predict", model, table("inf"))[0] == 5


@pytest.mark.parametrize(
    "name", [name if name == "ridge" else pytest.param(name, marks=pytest.mark.slow) for name in ESTIMATORS]
)
def test_a_number_is_predicted_from_extreme_features(name, monkeypatch):
    monkeypatch.setattr("graspsense.regression.model.FOLDS", 2)
    given = labelled()
    target = TargetValue(name="force", unit="N", values=tuple(float(i % 7) for i in range(len(given))))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        model = train_regression(name, evolve(given, value=target), name="m")
    for predicted in model.predict(table_of([[value] * 3 for value in EXTREMES])):
        assert math.isfinite(predicted.value)
        assert "unlike everything" in predicted.unlike
    # A feature that was constant in training tells nothing of its unit.
    same = evolve(given, value=target, table=evolve(given.table, values=given.table.values * (1.0, 1.0, 0.0)))
    made = train_regression(name, same, name="m")
    other = evolve(same.table, values=same.table.values + np.array([0.0, 0.0, 60.0]))
    assert [each.value for each in made.predict(other)] == [each.value for each in made.predict(same.table)]
