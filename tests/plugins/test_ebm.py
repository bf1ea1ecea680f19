"""Explainable boosting: our prediction is that of interpret, and a model needs interpret for training only."""

import json
import sys

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import python
from test_classifiers import fitted, trials

from graspsense.core.values.errors import PluginUnavailable
from graspsense.plugin_api import create
from graspsense.plugins.classifiers import ebm


@every_case("classes", [2, 3])
def test_probabilities_are_those_of_interpret(classes, monkeypatch):
    table, labels = trials(missing=0.1)
    if classes == 2:
        labels = [label.partition(":")[0] for label in labels]
    machines, convert = [], ebm._model_of
    monkeypatch.setattr(ebm, "_model_of", lambda machine, t: machines.append(machine) or convert(machine, t))
    classifier = fitted("ebm", table, labels, pairs=2, bags=2)
    (machine,) = machines
    bounds = np.array([machine.bins_[k][0][0] for k in range(3)])
    far = np.full(3, 1e6)
    asked = np.vstack((table.values, bounds, far, -far, np.full(3, np.nan)))
    ours = classifier.probabilities(evolve(table, values=asked))
    assert np.abs(ours - machine.predict_proba(asked)).max() < 1e-12
    assert classifier.classes() == tuple(machine.classes_)
    assert [term.features for term in classifier._model().terms] == list(machine.term_features_)


@pytest.mark.slow
def test_a_stored_model_predicts_without_interpret(tmp_path):
    table, labels = trials()
    classifier = fitted("ebm", table, labels, pairs=1, bags=2)
    (tmp_path / "m.json").write_text(json.dumps(classifier.to_json()))
    code = f"""
import json, sys
sys.modules["interpret"] = None
import numpy as np
from graspsense.core.values.features import FeatureTable
from graspsense.plugin_api import create
again = create("classifier", "ebm")
again.from_json(json.load(open({str(tmp_path / "m.json")!r})))
values = np.array({table.values.tolist()!r})
table = FeatureTable(names={table.names!r}, units={table.units!r}, values=values)
print(json.dumps(again.probabilities(table).tolist()))
assert "pandas" not in sys.modules and "sklearn" not in sys.modules
"""
    assert json.loads(python("-c", code, check=True).stdout) == classifier.probabilities(table).tolist()


def test_without_interpret_training_names_the_extra(monkeypatch):
    for name in ("interpret", "interpret.glassbox"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(PluginUnavailable, match=r"graspsense\[ebm\]"):
        fitted("ebm", *trials(n=3))


@every_case(
    ("key", "value", "problem"),
    [
        ("scores", [[0.0, 1.0, 2.0]], "does not fit"),
        ("features", [7], "does not fit"),
        ("cuts", [[2.0, 1.0]], "do not increase"),
    ],
)
def test_a_function_that_does_not_fit_is_refused(key, value, problem):
    term = {"features": [0], "cuts": [[1.0, 2.0]], "scores": [[0.0, 0.0, 1.0]] * 4}
    kept = {
        "features": [["p_first", "m"]],
        "labels": ["a", "b", "c"],
        "start": [0.0, 0.1, 0.2],
        "terms": [term],
    }
    create("classifier", "ebm").from_json(kept)
    term[key] = value
    with pytest.raises(ValueError, match=problem):
        create("classifier", "ebm").from_json(kept)


def test_no_pairs_are_sought_among_very_many_features(monkeypatch):
    monkeypatch.setattr(ebm, "MOST_PAIRED", 2)
    model = fitted("ebm", *trials(), pairs=2, bags=2)._model()
    assert all(len(term.features) == 1 for term in model.terms)
