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
from graspsense.core.learn.model_content import digest
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


def refused(tmp_path, text, says):
    """Check that a model whose estimator is this text is refused, although its hash fits."""
    trained("tree", tmp_path)
    path = tmp_path / "m.json"
    content = json.loads(path.read_text())
    content["model"]["skops"] = text
    content.pop("sha256")
    path.write_text(json.dumps({**content, "sha256": digest(content)}))
    with pytest.raises(DataDamaged, match=says):
        load_model(str(path), installed())


def trained(name, tmp_path):
    few = {"trees": 5} if name in ("forest", "extra-trees") else {}
    config = create("classifier", name, kept_as="skops", **few).config
    model = train(installed().find("classifier", name), config, trials(), name="m")
    write_model(tmp_path / "m.json", model)
    return model


SLOW = ("svm", "mlp", "extra-trees", "forest")


@pytest.mark.parametrize("name", ["tree", *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_it_comes_back_the_same_without_its_training_trials(name, tmp_path):
    model = trained(name, tmp_path)
    assert "trials" not in json.loads((tmp_path / "m.json").read_text())["model"]
    again = load_model(str(tmp_path / "m.json"), installed())
    asked = trials(2).table
    np.testing.assert_array_equal(again.answers(asked).scores, model.answers(asked).scores)
    assert again.predict(asked.row(0)).because == model.predict(asked.row(0)).because


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
    refused(tmp_path, base64.b64encode(other).decode(), says)


@every_case(
    "text", ["no base64!", *(base64.b64encode(d).decode() for d in (b"", b"no zip", b"\x80\x04K\x01."))]
)
def test_what_is_no_estimator_is_told(tmp_path, text):
    refused(tmp_path, text, "is damaged")


def test_without_skops_it_says_what_to_install(monkeypatch):
    for name in ("skops", "skops.io"):
        monkeypatch.setitem(sys.modules, name, None)
    classifier = create("classifier", "tree", kept_as="skops")
    classifier.fit(trials().table, trials().labels, 0)
    with pytest.raises(PluginUnavailable, match=r"graspsense\[skops\]"):
        classifier.to_json()
