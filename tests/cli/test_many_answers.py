"""A model asked about many trials at once says what it says of each alone."""

import numpy as np
import pytest
from commands import answered, printed

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.training import train
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import UNKNOWN, FeatureTable
from graspsense.plugin_api import create

NAMES = ("p_first", "f_steady", "dp_dt")


def table(rows):
    return FeatureTable(names=NAMES, units=("m", "N", "m/s"), values=np.asarray(rows, dtype=np.float64))


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(4)
    values = rng.normal(size=(240, 3)) + np.repeat(np.arange(3.0), 80)[:, None] * 1.5
    values[rng.random(values.shape) < 0.1] = np.nan
    return values


@pytest.mark.slow
@pytest.mark.parametrize("name", ["c45", "knn", "tree", "svm"])
def test_all_at_once_is_one_by_one(rows, name):
    model = trained(rows, name, tuple(np.repeat(["a:x", "b:y", "c:z"], 80).tolist()))
    far = np.array([[50.0, 0.0, 0.0], [np.nan, np.nan, np.nan], [0.0, np.nan, -70.0]])
    asked = table(np.concatenate((rows, rows + 2.0, far)))
    answers = model.answers(asked)
    predicted = [
        UNKNOWN if far else name for name, far in zip(answers.predicted, answers.unlike, strict=True)
    ]
    alone = [model.predict(asked.row(i)) for i in range(len(asked))]
    assert predicted == [prediction.label for prediction in alone]
    assert UNKNOWN in predicted
    assert set(predicted) > {"a:x", "b:y", "c:z"}
    expected = [list(prediction.probabilities.values()) for prediction in alone]
    np.testing.assert_allclose(answers.probabilities, expected, atol=1e-12)


def trained(rows, name, labels):
    labelled = Labelled(source="made up", table=table(rows), labels=labels)
    component = installed().find("classifier", name)
    return train(component, create("classifier", name).config, labelled, name="m")


def test_a_table_without_a_feature_of_the_model_is_refused(rows):
    with pytest.raises(ConfigError, match=r"'m'.* f_steady "):
        trained(rows, "knn", ("a", "b", "c") * 80).answers(table(rows).columns(["p_first", "dp_dt"]))


@pytest.mark.slow
def test_predict_answers_many_without_reasons_and_says_so(rows, tmp_path):
    lines = ["label,p_first [m],f_steady [N],dp_dt [m/s]"]
    for k, row in enumerate(np.tile(rows, (5, 1)).tolist()):
        lines.append(",".join([("a", "b", "c")[k % 240 // 80], *("" if v != v else repr(v) for v in row)]))
    (tmp_path / "t.csv").write_text("\n".join(lines))
    source, model = str(tmp_path / "t.csv"), str(tmp_path / "m.json")

    printed("train", source, "--label", "label", "--classifier", "tree", "--out", model)
    answer = answered("predict", model, source, "--label", "label")
    assert answer["n"] == len(answer["predictions"]) == 1200
    assert any("no reasons" in note for note in answer["notes"])
    right = sum(prediction["label"] == prediction["truth"] for prediction in answer["predictions"])
    assert answer["rate"]["correct"] == right > 600
