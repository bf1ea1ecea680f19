"""Models are data: whatever a model file says, it is refused as damaged, or answers, in bounded time and memory."""

import base64
import copy
import json
import math
from functools import cache
from io import BytesIO
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
import parts
import pytest
from attrs import evolve
from cases import every_case
from commands import python
from parts import Nearest
from repository import TESTS
from test_classifiers import trials

from graspsense.core.components.registry import Component, installed
from graspsense.core.learn.certainty import Certainty, LabelShare, SupportClass
from graspsense.core.learn.conformal import LabelThreshold, PredictionSets
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model import checkpoint_model
from graspsense.core.learn.model_content import digest
from graspsense.core.learn.model_file import as_json, classifier_from, load_model, write_model
from graspsense.core.learn.stored_values import StoredValues
from graspsense.core.learn.training import train
from graspsense.core.values.errors import DataDamaged
from graspsense.plugin_api import create
from graspsense.regression.model import is_regression

SMALL = {
    "forest": {"trees": 3},
    "extra-trees": {"trees": 3},
    "boosted": {"stages": 3},
    "mlp": {"hidden": 3},
    "backprop": {"epochs": 5},
    "ebm": {"bags": 1, "pairs": 1},
}
KINDS = ["c45", "svm", "mlp", "backprop", "forest", "extra-trees", "boosted", "ebm", "knn", "tree"]
KEPT_AS_SKOPS = ["svm", "mlp", "forest", "extra-trees", "tree"]


def labelled(n=5):
    table, labels = trials(n=n)
    return Labelled(source="a test", table=table, labels=tuple(labels), provenance={"simulated": True})


@cache
def trained(name, **config):
    """A model with everything that a file can have: certainty, prediction sets and a checkpoint."""
    component = installed().find("classifier", name)
    settings = create("classifier", name, **{**SMALL.get(name, {}), **config}).config
    provenance = {"settings": {"controller": {"type": "hybrid", "probing_force_n": 20.0}}}
    model = train(component, settings, labelled(), name="m", seed=4, provenance=provenance)
    labels = model.classifier.classes()
    sets = PredictionSets(
        coverage=0.9,
        unit="trials",
        thresholds=dict.fromkeys(labels, LabelThreshold(score=0.1, units=9)),
        of_support=(0.1, 0.2),
        unknown=1,
        trials=15,
    )
    low = SupportClass(least=0.0, probabilities=(0.4, 0.9), rates=(0.3, 0.7), units=30.0)
    of_label = dict.fromkeys(labels, (LabelShare(share=0.9, low=0.7, high=1.1),) * 2)
    certainty = Certainty(classes=(low, evolve(low, least=4.0)), of_label=of_label, reach=2.0)
    model = evolve(model, sets=sets, certainty=certainty)
    return evolve(model, checkpoints=((0.2, checkpoint_model(model, 0.2, model)),))


def other_trees(estimator):
    """Trees of a random forest with the labels and the number of features of this estimator."""
    from sklearn.ensemble import RandomForestClassifier

    rows = np.random.default_rng(0).normal(size=(30, estimator.n_features_in_))
    labels = np.resize(estimator.classes_, 30)
    return RandomForestClassifier(n_estimators=estimator.n_estimators).fit(rows, labels).estimators_


def resealed(path, change):
    """Change the content of a model, and give it the hash of the changed one."""
    content = json.loads(path.read_text())
    change(content)
    content.pop("sha256")
    path.write_text(json.dumps({**content, "sha256": digest(content)}))


SOME = pytest.param((2, 12, 5), 50, marks=pytest.mark.slow, id="some")
EVERY = pytest.param((0, 0, 0), 1000, marks=pytest.mark.long, id="every")


@pytest.mark.parametrize(
    ("names", "kept_as"),
    [(KINDS, {}), (["mlp"], {"kept_as": "weights"}), (KEPT_AS_SKOPS, {"kept_as": "skops"})],
)
@pytest.mark.parametrize(("damages", "least"), [SOME, EVERY])
def test_damages_of_a_model_are_refused_or_answer(tmp_path, names, kept_as, damages, least):
    if names is KEPT_AS_SKOPS:
        pytest.importorskip("skops", reason="the extra 'skops' is not installed")
    files = [tmp_path / f"{name}.json" for name in names]
    for name, file in zip(names, files, strict=True):
        write_model(file, trained(name, **kept_as))
    done = python(TESTS / "damaged_models.py", *damages, *files)
    assert done.stdout.startswith("ok "), done.stderr[-3000:]
    assert int(done.stdout.split()[1]) >= len(names) * least


@every_case(
    ("name", "settings"),
    [
        ("mlp", {"hidden": 10**9}),
        ("backprop", {"hidden": 10**9}),
        ("backprop", {"epochs": 10**12}),
        ("backprop", {"epochs": 10**5, "hidden": 10**4}),
        ("forest", {"trees": 10**9}),
        ("boosted", {"stages": 10**4}),
        ("boosted", {"depth": 10**6}),
        ("knn", {"neighbours": 0}),
        ("svm", {"c": 1e300}),
        ("tree", {"min_leaf": 10**30}),
        ("c45", {"rep_folds": -1}),
        ("c45", {"further": 1}),
    ],
)
def test_settings_that_would_take_all_memory_or_time_are_refused(tmp_path, name, settings):
    path = tmp_path / "m.json"
    write_model(path, trained(name))
    resealed(path, lambda content: content["settings"].update(settings))
    with pytest.raises(DataDamaged, match=r"is damaged: (settings\.|model: .*with these settings)"):
        load_model(str(path), installed())


@every_case(
    ("text", "says"),
    [
        ("[" * 100_000 + "]" * 100_000, "nested too deeply"),
        ('{"format": "graspsense model", "a": ' + "[" * 400 + "]" * 400 + "}", "nested too deeply"),
        ('{"format": "graspsense model", "format": "graspsense model"}', "is there twice"),
        ('{"a": NaN}', "a finite number"),
        ('{"a": 1e400}', "a finite number"),
        ('{"a": ' + "9" * 200 + "}", "200 digits"),
        ('{"a": "\\ud800"}', "is not JSON"),
    ],
)
def test_what_is_no_strict_json_is_refused(tmp_path, text, says):
    (tmp_path / "m.json").write_text(text)
    with pytest.raises(DataDamaged, match=says):
        load_model(str(tmp_path / "m.json"), installed())
    assert not is_regression(str(tmp_path / "m.json"))


@every_case(
    ("place", "value"),
    [
        ("provenance.simulated", 1),
        ("provenance.settings.controller", [1]),
        ("provenance.after_contact_s", 0.1),
        ("sets.coverage", 0.999_999_999),
        ("sets.thresholds.bottle:empty", [0.1, 9]),
        ("sets.thresholds.bottle:empty.score", "high"),
        ("sets.thresholds", {"bottle:empty": {"score": 0.1, "units": 9}}),
        ("sets.of_support", [0.1]),
        ("certainty.0.rates", [0.3, 1.7]),
        ("certainty.0.probabilities", [0.9, 0.4]),
        ("certainty.1.support", 0.0),
        ("certainty_of_label.bottle:empty", [0.95, 0.9, 1.1]),
        ("certainty_of_label.bottle:empty", [[0.7, 0.9, 1.1]]),
        ("certainty_of_label.bottle:empty", [[0.7, 0.9, 1.1], 0.9]),
        ("certainty_reach", -1.0),
        ("checkpoints.0.certainty", [{}]),
        ("sets.unknown", 16),
        ("unknown.spread", [1.0, 1.0]),
        ("unknown.spread", [1.0, -1.0, 1.0]),
        ("unknown.ranges.bottle:empty", [[1.0, 1.0, 1.0], [0.0, 2.0, 2.0]]),
        ("unknown.reach", 5.0),
        ("unknown.ranges", {}),
        ("unknown.spread", []),
        ("unknown", {"reach": 3.0}),
        ("features", None),
        ("features", [["p_first"]]),
        ("features", [["p_first", "m"], ["p_first", "m"], ["noise", ""]]),
        ("model", None),
        ("model", {}),
        ("model.nodes.n_children", [4_294_967_298] + [0] * 4),
        ("checkpoints.0.after_contact_s", -1.0),
        ("checkpoints.0.trials", 1.5),
        ("checkpoints.0.model", {}),
    ],
)
def test_a_value_that_does_not_fit_is_refused_by_the_name_of_its_field(tmp_path, place, value):
    path = tmp_path / "m.json"
    write_model(path, trained("c45"))

    def change(content):
        *tables, key = place.split(".")
        for step in tables:
            content = content[int(step) if step.isdigit() else step]
        content[key] = value

    resealed(path, change)
    with pytest.raises(DataDamaged) as refused:
        load_model(str(path), installed())
    assert place.removesuffix(".bottle:empty") in str(refused.value).replace(": nodes", ".nodes").replace(
        "model: StoredTreeError: damaged stored tree", "model"
    )


def test_a_model_with_one_share_for_each_label_has_it_in_every_class_of_support(tmp_path):
    path, model = tmp_path / "m.json", trained("c45")
    write_model(path, model)
    shares = {label: [0.7, 0.9, 1.1] for label in model.certainty.of_label}
    resealed(path, lambda content: content.update(certainty_of_label=shares))
    assert load_model(str(path), installed()).certainty.of_label == model.certainty.of_label


class Wayward(Nearest):
    """Raises what its contract does not allow, and then gives what is no probability."""

    def from_json(self, model):
        super().from_json(model)
        if model["mean"][0] == "raise":
            raise ZeroDivisionError("mean")


@pytest.mark.parametrize("mean", [["raise", 0.0, 0.0], ["x", 0.0, 0.0], [0.0, 0.0]])
def test_whatever_a_classifier_raises_on_a_file_is_damage_of_the_file(mean):
    entry = evolve(parts.ENTRIES["classifier"], target="test_damaged_models:Wayward")
    component = Component(entry, "graspsense-test", "0.1")
    model = train(component, component.config_class()(), labelled(), name="m")
    kept = as_json(model)
    kept["model"] = {**kept["model"], "mean": mean}
    with pytest.raises(DataDamaged):
        classifier_from(StoredValues(kept), component, component.config_class()(), model.names, model.units)


def refuse_text(tmp_path, name, text, says):
    path = tmp_path / "m.json"
    write_model(path, trained(name, kept_as="skops"))
    resealed(path, lambda content: content["model"].update(skops=text))
    with pytest.raises(DataDamaged, match=says):
        load_model(str(path), installed())


@pytest.mark.slow
class TestKeptAsSkops:
    """The compiled code of scikit-learn trusts its arrays; each that does not fit is refused before it is used."""

    @pytest.fixture(autouse=True)
    def _skops(self):
        pytest.importorskip("skops", reason="the extra 'skops' is not installed")

    @staticmethod
    def refused(tmp_path, name, change):
        from graspsense.plugins.classifiers.skops_text import as_text

        estimator = copy.deepcopy(trained(name, kept_as="skops").classifier._fitted.estimator)
        change(estimator)
        refuse_text(tmp_path, name, as_text(estimator), r"model\.skops")

    @every_case(
        ("attribute", "change"),
        [
            ("support_vectors_", lambda values: values[:-1]),
            ("support_vectors_", lambda values: values[:, :2].copy()),
            ("support_vectors_", lambda values: np.full_like(values, np.nan)),
            ("support_", lambda values: values[:-1]),
            ("support_", lambda values: values.astype(np.int64)),
            ("_n_support", lambda values: values + 1000),
            ("_n_support", lambda values: values - 2),
            ("_n_support", lambda values: np.concatenate((values, [0])).astype(np.int32)),
            ("_dual_coef_", lambda values: values[:, :-1].copy()),
            ("_dual_coef_", lambda values: np.full_like(values, np.inf)),
            ("dual_coef_", lambda values: values[:1]),
            ("_intercept_", lambda values: values[:1]),
            ("_probA", lambda values: np.ones(3)),
            ("classes_", lambda values: values[:2]),
            ("classes_", lambda values: np.array(["a", "a", "a"])),
            ("_gamma", lambda value: math.nan),
            ("kernel", lambda value: "poly"),
            ("decision_function_shape", lambda value: "ovo"),
            ("shape_fit_", lambda value: (3, 10**9)),
        ],
    )
    def test_a_machine(self, tmp_path, attribute, change):
        def damage(estimator):
            setattr(estimator, attribute, change(getattr(estimator, attribute)))

        self.refused(tmp_path, "svm", damage)

    @every_case(
        "change",
        [
            lambda network: network.coefs_.pop(),
            lambda network: network.coefs_.__setitem__(0, network.coefs_[0][:1]),
            lambda network: network.intercepts_.__setitem__(1, network.intercepts_[1][:1]),
            lambda network: network.coefs_.__setitem__(0, np.full_like(network.coefs_[0], 1e308)),
            lambda network: setattr(network, "n_layers_", 10**9),
            lambda network: setattr(network, "out_activation_", "identity"),
            lambda network: setattr(network, "hidden_layer_sizes", (10**9,)),
        ],
    )
    def test_a_network(self, tmp_path, change):
        self.refused(tmp_path, "mlp", change)

    @every_case(
        ("column", "row", "value"),
        [
            ("left_child", 0, 10**6),
            ("left_child", 1, 0),
            ("right_child", 0, 1),
            ("feature", 0, 3),
            ("feature", 0, -7),
            ("threshold", 0, math.nan),
            ("n_node_samples", 0, 0),
        ],
    )
    @every_case("name", ["tree", "forest"])
    def test_a_tree(self, tmp_path, name, column, row, value):
        def damage(estimator):
            tree = estimator.estimators_[1].tree_ if name == "forest" else estimator.tree_
            state = tree.__getstate__()
            state["nodes"][column][row] = value
            tree.__setstate__(state)

        self.refused(tmp_path, name, damage)

    def test_a_forest_of_other_trees(self, tmp_path):
        self.refused(tmp_path, "forest", lambda forest: forest.estimators_.pop())
        self.refused(tmp_path, "forest", lambda forest: setattr(forest, "n_jobs", 10**6))
        self.refused(tmp_path, "extra-trees", lambda trees: setattr(trees, "estimators_", other_trees(trees)))

    def test_an_archive_that_is_larger_than_it_looks(self, tmp_path):
        header = BytesIO()
        shape = {"descr": "<f8", "fortran_order": False, "shape": (10**12,)}
        np.lib.format.write_array_header_1_0(header, shape)
        for compression in (ZIP_DEFLATED, ZIP_STORED):
            data = BytesIO()
            with ZipFile(data, "w", compression) as archive:
                archive.writestr("x.npy", header.getvalue())
            text = base64.b64encode(data.getvalue()).decode()
            refuse_text(tmp_path, "tree", text, r"compressed|not as long as it says")
