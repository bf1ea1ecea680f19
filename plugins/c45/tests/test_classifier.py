"""The scikit-learn face."""

from pathlib import Path

import numpy as np
import pytest
from attrs import asdict
from cases import every_case

from graspsense_c45 import C45Classifier, Options, fit, hold_out, read_arff
from graspsense_c45.options import PAPER

WEATHER = Path(__file__).parent / "weka" / "arff" / "weather.nominal.arff"


def expected_failures(classifier):
    why = "rows are held out by their place: one left out or repeated moves others to other folds, as in J48"
    check = "check_sample_weight_equivalence_on_dense_data"
    return {check: why} if classifier.pruning == "reduced_error" else {}


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, asdict(PAPER), {"laplace": True, "pruning": "none"}])
@pytest.mark.filterwarnings("ignore")
def test_scikit_learns_checks(options):
    from sklearn.utils.estimator_checks import check_estimator

    classifier = C45Classifier(**options)
    check_estimator(classifier, expected_failed_checks=expected_failures(classifier), on_skip=None)


def test_defaults_are_j48s_and_presets_are_named():
    assert C45Classifier().get_params() == C45Classifier.j48().get_params()
    assert C45Classifier().get_params().items() >= asdict(Options()).items()
    paper = C45Classifier.paper(rep_folds=5).get_params()
    expected = {"criterion": "info_gain", "pruning": "reduced_error", "mdl_correction": False, "rep_folds": 5}
    assert paper.items() >= expected.items()


@every_case(
    "names", [["no", "yes"], [10, 20], [True, False], np.array(["b", "a"], dtype=object), [-1.0, 1.0]]
)
def test_labels_come_back_as_they_were(names):
    y = np.array([names[0], names[1]] * 4, dtype=object if isinstance(names, np.ndarray) else None)
    x = np.array([[0.0], [1.0]] * 4)
    classifier = C45Classifier().fit(x, y)
    assert classifier.predict(x).tolist() == y.tolist()
    assert classifier.predict(x).dtype == classifier.classes_.dtype
    again = C45Classifier.from_json(classifier.to_json())
    assert again.predict(x).tolist() == y.tolist()
    assert repr([*again.tree_.schema.classes]) == repr(classifier.classes_.tolist())


def test_declared_classes_enter_the_tree():
    x, y = np.arange(20.0)[:, None], np.array(["b"] * 10 + ["a"] * 10)
    classifier = C45Classifier(classes=["c", "b", "a"]).fit(x, y)
    assert classifier.classes_.tolist() == ["c", "b", "a"]
    assert classifier.predict_proba(x)[0].tolist() == [0.0, 1.0, 0.0]
    with pytest.raises(ValueError, match=r"\['b'\]"):
        C45Classifier(classes=["a"]).fit(x, y)


def weather():
    import pandas as pd

    table = read_arff(WEATHER)
    columns = {
        a.name: pd.Categorical.from_codes(table.values[:, i].astype(int), list(a.values or ()))
        for i, a in enumerate(table.schema.attributes)
    }
    return pd.DataFrame(columns), [table.schema.classes[k] for k in table.labels], fit(table)


def test_categorical_columns_are_nominal():
    frame, y, expected = weather()
    classifier = C45Classifier(classes=["yes", "no"]).fit(frame, y)
    assert classifier.tree_ == expected
    predicted = classifier.predict(frame).tolist()
    assert predicted == np.array(["yes", "no"])[classifier.predict_proba(frame).argmax(axis=1)].tolist()
    assert "outlook = sunny" in classifier.to_text()
    # The same by a mask on an array of strings; the declared values are then those that occur, sorted.
    text = frame.astype(str)
    masked = C45Classifier(nominal=[True] * 4).fit(text.to_numpy(dtype=object), y)
    assert masked.predict(text.to_numpy(dtype=object)).tolist() == predicted
    named = C45Classifier(nominal=["outlook", "humidity", "temperature", "windy"]).fit(text, y)
    assert named.predict(text).tolist() == predicted


def test_unknown_and_missing_categories_are_missing():
    frame, y, _ = weather()
    classifier = C45Classifier().fit(frame.astype(str).astype("category"), y)
    row = frame.astype(str).iloc[[0]]
    known, unknown, missing = (
        classifier.predict_proba(row.assign(outlook=value)).tolist()
        for value in (row["outlook"], "hail", None)
    )
    assert unknown == missing != known


def test_mixed_columns():
    import pandas as pd

    frame = pd.DataFrame({"colour": pd.Categorical(["r", "g"] * 6), "size": [1.0, 2.0, 3.0, None] * 3})
    y = ["a" if colour == "r" else "b" for colour in frame["colour"]]
    classifier = C45Classifier().fit(frame, y)
    assert classifier.predict(frame).tolist() == y
    with pytest.raises(ValueError, match="holds text"):
        C45Classifier(nominal=[True, False]).fit(np.array([["r", "big"], ["g", "small"]], object), ["a", "b"])
    with pytest.raises(ValueError, match=r"\['shape'\]"):
        C45Classifier(nominal=["shape"]).fit(frame, y)
    for nominal in ([2], [-1], [True], [True, False, False]):
        with pytest.raises(ValueError, match=r"columns 0\.\.1"):
            C45Classifier(nominal=nominal).fit(frame, y)


def test_hold_out_by_rows_by_folds_and_shuffled():
    from sklearn.datasets import load_iris

    x, y = load_iris(return_X_y=True)
    rng = np.random.default_rng(0)
    x = x + rng.normal(0, 0.5, x.shape)
    by_folds = C45Classifier.paper().fit(x, y)
    mask = np.zeros(len(y), dtype=bool)
    mask[hold_out(y, 3)] = True
    for rows in (mask, np.flatnonzero(mask)):
        assert C45Classifier.paper().fit(x, y, holdout=rows).tree_ == by_folds.tree_
    shuffled = [C45Classifier.paper(random_state=seed).fit(x, y).tree_ for seed in (1, 1, 2)]
    assert shuffled[0] == shuffled[1] != shuffled[2]
    with pytest.raises(ValueError, match="holdout"):
        C45Classifier.paper().fit(x, y, holdout=[150])
    with pytest.raises(ValueError, match=r"'reduced_error'.*'pessimistic'"):
        C45Classifier().fit(x, y, holdout=mask)


def test_an_unknown_engine_option_is_refused():
    for option in ({"criterion": "gini"}, {"engine": "gpu"}):
        with pytest.raises(ValueError, match=repr(*option.values())):
            C45Classifier(**option).fit([[0.0], [1.0]], [0, 1])
