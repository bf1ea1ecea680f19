"""Models that are kept as their fitted estimator, through skops, and what is refused of them."""

import base64
import json
import sys
from importlib import import_module

import numpy as np
import pytest
from cases import every_case
from sklearn.linear_model import LogisticRegression
from sklearn.neighbors import KNeighborsClassifier

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model_file import load_model, write_model
from graspsense.core.learn.training import train
from graspsense.core.values.errors import DataDamaged, PluginUnavailable
from graspsense.core.values.features import FeatureTable
from graspsense.plugin_api import create


def trials(seed=1):
    values = np.random.default_rng(seed).normal(size=(60, 3)) + np.repeat(np.arange(3.0), 20)[:, None] * 2.0
    values[3, 1] = np.nan
    table = FeatureTable(names=("a", "b", "c"), units=("m", "N", "s"), values=values)
    return Labelled(source="made up", table=table, labels=("x",) * 20 + ("y",) * 20 + ("z",) * 20)


def trained(name, tmp_path):
    few = {"trees": 5} if name in ("forest", "extra-trees") else {}
    config = create("classifier", name, kept_as="skops", **few).config
    model = train(installed().find("classifier", name), config, trials(), name="m")
    write_model(tmp_path / "m.json", model)
    return model


@pytest.mark.parametrize(
    "name",
    [
        "tree",
        "forest",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("svm", "mlp", "extra-trees")),
    ],
)
def test_it_comes_back_the_same_without_its_training_trials(name, tmp_path):
    model = trained(name, tmp_path)
    content = json.loads((tmp_path / "m.json").read_text())
    assert "trials" not in content["model"]
    again = load_model(str(tmp_path / "m.json"), installed())
    asked = trials(2).table
    assert again.answers(asked)[0] == model.answers(asked)[0]
    assert (again.answers(asked)[1] == model.answers(asked)[1]).all()
    assert again.predict(asked.row(0)).because == model.predict(asked.row(0)).because


def resigned(path, change):
    """Change a model's content and give it the hash of the changed one, as somebody with bad intent would."""
    from graspsense.core.learn.model_content import digest

    content = json.loads(path.read_text())
    change(content["model"])
    content.pop("sha256")
    path.write_text(json.dumps({**content, "sha256": digest(content)}))


def with_estimator(tmp_path, text):
    """Return the file of a model whose estimator is this text."""
    trained("tree", tmp_path)
    resigned(tmp_path / "m.json", lambda model: model.update(skops=text))
    return str(tmp_path / "m.json")


@every_case(
    ("estimator", "says"),
    [
        (KNeighborsClassifier(), r"types that no model of ours needs: .*KDTree"),
        (LogisticRegression(), "no DecisionTreeClassifier of 3 features"),
    ],
)
def test_an_estimator_of_another_kind_is_refused_before_anything_is_made(tmp_path, estimator, says):
    rows = np.random.default_rng(1).normal(size=(20, 3))
    other = import_module("skops.io").dumps(estimator.fit(rows, [0, 1] * 10))
    with pytest.raises(DataDamaged, match=says):
        load_model(with_estimator(tmp_path, base64.b64encode(other).decode()), installed())


@every_case("data", [b"", None, b"no archive", b"\x80\x04K\x01."])
def test_what_is_no_estimator_is_told(tmp_path, data):
    text = "no base64!" if data is None else base64.b64encode(data).decode()
    with pytest.raises(DataDamaged, match="is damaged"):
        load_model(with_estimator(tmp_path, text), installed())


def test_without_skops_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "skops", None)
    monkeypatch.setitem(sys.modules, "skops.io", None)
    classifier = create("classifier", "tree", kept_as="skops")
    labelled = trials()
    classifier.fit(labelled.table, labelled.labels, 0)
    with pytest.raises(PluginUnavailable, match=r"graspsense\[skops\]"):
        classifier.to_json()
