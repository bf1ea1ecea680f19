"""Features of any size: an answer with probabilities, or a refusal that names the feature; no warning, no bug."""

import json
import math
import warnings

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense
from test_classifiers import NAMES, UNITS, trials
from test_damaged_models import KINDS, SMALL, labelled, trained

from graspsense.core.learn.target_value import TargetValue
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.features import UNKNOWN, Features, FeatureTable
from graspsense.plugin_api import create
from graspsense.regression.estimators import ESTIMATORS
from graspsense.regression.model import train_regression

FEW = ["c45", "svm", "knn"]
REST = [name for name in KINDS if name not in FEW]
EXTREMES = (1e308, -1e308, 1.7e308, 1e154, 1e39, 5e-324, -5e-324, 0.0)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", [*FEW, *(pytest.param(name, marks=pytest.mark.slow) for name in REST)])
def test_a_trial_of_extreme_features_has_probabilities_and_is_unknown_where_it_is_far_away(name):
    model = trained(name)
    rows = [[value, 8.0, 0.0] for value in EXTREMES] + [[value] * 3 for value in EXTREMES]
    table = FeatureTable(names=NAMES, units=UNITS, values=np.array(rows))
    labels, shares = model.answers(table)
    assert shares.sum(axis=1) == pytest.approx(np.ones(len(rows)))
    model.predictions(table)
    for i, row in enumerate(rows):
        prediction = model.predict(table.row(i))
        assert prediction.label == labels[i] == UNKNOWN  # each first feature is far from every bottle and can
        assert sum(prediction.probabilities.values()) == pytest.approx(1.0)
        assert "unlike everything trained on" in prediction.because[0].words
        assert model.classifier.explain(Features(names=NAMES, values=tuple(row), units=UNITS)).because


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


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", [*FEW, *(pytest.param(name, marks=pytest.mark.slow) for name in REST)])
@every_case("factor", [1e-320, 1e-300, 1e90])
def test_features_of_any_usual_size_are_learned(name, factor):
    """Those below the square root of the least number may count as constant; the answer is still one."""
    table, labels = trials(n=6)
    table = evolve(table, values=table.values * factor)
    classifier = create("classifier", name, **SMALL.get(name, {}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a network that has not converged
        classifier.fit(table, labels, 1)
    shares = classifier.probabilities(table)
    assert shares.sum(axis=1) == pytest.approx(np.ones(len(labels)))
    assert classifier.explain(table.row(0)).because


@pytest.fixture
def table(tmp_path):
    """A table to learn from, tables with one extreme cell."""
    rng = np.random.default_rng(0)
    rows = [f"{'ab'[i % 2]},{i % 2 + 0.1 * rng.normal():.4f},{rng.normal():.4f}" for i in range(24)]

    def table(cell=None):
        lines = ["what,width [m],force [N]", *rows]
        if cell is not None:
            lines[7] = f"{lines[7].split(',')[0]},{cell},0.5"
        path = tmp_path / f"{cell}.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return table


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", ["c45", pytest.param("svm", marks=pytest.mark.slow)])
def test_commands_answer_or_name_the_column(table, tmp_path, name):
    model = tmp_path / "m.json"
    train = ("train", "--label", "what", "--classifier", name, "--overwrite", "--out", model)
    for cell in ("1e308", "-1e308", "inf", "1e400", "-inf"):
        for command in (train, ("evaluate", "--label", "what", "--classifier", name)):
            code, _, err = graspsense(*command, table(cell))
            assert code == 5
            assert "width" in err
    assert graspsense(*train, table("5e-324"))[0] == 0
    for cell in ("1e308", "-1e308"):
        code, out, _ = graspsense("predict", model, table(cell), "--json")
        assert code == 0
        said = json.loads(out)["predictions"][6]
        assert said["label"] == UNKNOWN
        assert sum(said["probabilities"].values()) == pytest.approx(1.0)
    assert graspsense("predict", model, table("inf"))[0] == 5


@pytest.mark.filterwarnings("error::RuntimeWarning")
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
    rows = np.array([[value] * 3 for value in EXTREMES])
    for predicted in model.predict(FeatureTable(names=NAMES, units=UNITS, values=rows)):
        assert math.isfinite(predicted.value)
        assert "unlike everything trained on" in predicted.unlike
