"""Texts of a table are nominal features of every classifier; ARFF files are read as their header says."""

import numpy as np
import pytest
from cases import every_case
from commands import answered, printed
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.settings.selected import select_component
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.nominal import codes_of, value_name, with_codes
from graspsense.evaluation.evaluate import evaluate
from graspsense.sources.trial_source import load_trials
from graspsense.sources.trial_table.features_csv import read_labelled, read_table

WEATHER = """\
% The weather data of J. R. Quinlan (1986).
@RELATION weather

@attribute outlook {sunny, overcast, 'very rainy'}
@attribute temperature REAL
@attribute humidity integer
@attribute windy {TRUE, FALSE}
@attribute play {yes, no}

@data
sunny,85,85,FALSE,no
sunny,80,90,TRUE,no
overcast,83,86,FALSE,yes
'very rainy',70,96,FALSE,yes
'very rainy',68,80,FALSE,yes
'very rainy',65,70,TRUE,no
overcast,64,65,TRUE,yes
sunny,72,95,FALSE,no
sunny,69,70,FALSE,yes
'very rainy',75,80,FALSE,yes
sunny,75,70,TRUE,yes
overcast,72,90,TRUE,yes
overcast,81,75,FALSE,yes
"very rainy",71,91,TRUE,no
"""


@pytest.fixture
def weather(tmp_path):
    path = tmp_path / "weather.arff"
    path.write_text(WEATHER)
    return path


def shapes(folder):
    """Write trials whose label is decided by a text and a number together, with some texts missing."""
    rng = np.random.default_rng(0)
    lines = []
    for i, weight in enumerate(rng.uniform(0.0, 1.0, 60)):
        colour = ("red", "green", "blue")[i % 3]
        label = "a" if colour == "red" or (colour == "blue" and weight > 0.5) else "b"
        lines.append(f"{label},{colour if i % 20 else ''},{weight:.6f}")
    path = folder / "shapes.csv"
    path.write_text("what,colour,weight [kg]\n" + "\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    "classifier",
    ["c45", "knn", "tree", *(pytest.param(name, marks=pytest.mark.slow) for name in ("ebm", "svm"))],
)
def test_a_text_reaches_every_classifier(tmp_path, classifier):
    trials = read_labelled(shapes(tmp_path), "what")
    assert trials.table.names == ("colour=blue", "colour=green", "colour=red", "weight")
    component = select_component("classifier", classifier)
    options = {"folds": 5, "controls": False, "learning_curve": False}
    evaluation = evaluate(component, trials, classifier=classifier, **options)
    # The weight alone decides for one of three colours: 2 of 3 and no more are right without the colour.
    assert evaluation.headline.rate > 0.8


def test_c45_grows_the_published_tree_of_the_weather_data(weather):
    trials = load_trials(str(weather))
    classifier = select_component("classifier", "c45").create()
    classifier.fit(trials.table, trials.labels, 0)
    assert [(node.branch, node.label, node.trials, node.wrong) for node in classifier.tree()] == [
        ("", "yes", 14.0, 5.0),
        ("outlook = sunny", "no", 5.0, 2.0),
        ("outlook = overcast", "yes", 4.0, 0.0),
        ("outlook = very rainy", "yes", 5.0, 2.0),
        ("humidity ≤ 75", "yes", 2.0, 0.0),
        ("humidity > 75", "no", 3.0, 0.0),
        ("windy = TRUE", "no", 2.0, 0.0),
        ("windy = FALSE", "yes", 3.0, 0.0),
    ]
    because = {reason.words for reason in classifier.explain(trials.table.row(13)).because}
    assert {"outlook = very rainy", "windy = TRUE"} <= because
    with pytest.raises(ConfigError, match="no column 'x'"):
        load_trials(str(weather), label="x")


def test_a_model_of_nominal_features_predicts_from_other_tables(weather, tmp_path):
    model, other = tmp_path / "m.json", tmp_path / "other.csv"
    printed("train", weather, "--out", model)
    other.write_text(
        "windy,humidity,outlook,temperature\nTRUE,70,overcast,60\nFALSE,90,sunny,80\nTRUE,80,foggy,70\n"
    )
    predictions = answered("predict", model, other)["predictions"]
    assert [prediction["label"] for prediction in predictions[:2]] == ["yes", "no"]
    # A value that the training did not have is as a missing one.
    assert any("outlook is missing" in reason["words"] for reason in predictions[2]["because"])


def test_arff_is_read_as_it_is_written(tmp_path):
    path = tmp_path / "t.arff"
    path.write_text(
        "@relation 'a % b'\r\n"
        "@attribute 'p first [m]' numeric % a comment\r\n"
        "@ATTRIBUTE level {1, 2, none, '?'}\r\n"
        "@attribute note string\r\n"
        "@attribute day date 'yyyy-MM-dd'\r\n"
        "@attribute class {b, a, never}\r\n"
        "@data\r\n" + "1.5e-3, 1, 'it\\'s', '2026-11-26', a\r\n"
        "?, none, ?, '2026-11-27', b, {2}\r\n"
        "{0 2.5, 1 2, 4 a}\r\n"
        "4 '?' x '2026-11-28' b\r\n"
        "4 '?' x '2026-11-28' ?\r\n" * 4
    )
    trials = read_labelled(path, None)
    table, values = trials.table, trials.table.values[:4]
    assert trials.labels == ("a", "b", "a", "b") * 4
    assert table.names == ("p first", "level=1", "level=2", "level=none", "level=?", "note=it's", "note=x")
    assert table.units[0] == "m"
    np.testing.assert_array_equal(values[:, 0], [1.5e-3, np.nan, 2.5, 4.0])
    np.testing.assert_array_equal(values[:, 1:5].argmax(axis=1), [0, 2, 1, 3])
    assert np.isnan(values[1, 5:]).all()
    for said in ("4 trials", "weights"):
        assert any(said in note for note in trials.notes)
    assert "class=b" in read_labelled(path, "level").table.names


ROW, WINDY = "sunny,85,85,FALSE,no", "@attribute windy {TRUE, FALSE}"


@every_case(
    ("old", "new", "line"),
    [
        (ROW, "snowy,85,85,FALSE,no", "line 11.*snowy"),
        (ROW, "sunny,85,85,FALSE", "line 11.*4 values"),
        (ROW, "sunny,hot,85,FALSE,no", "line 11.*hot"),
        (ROW, "sunny,'85,85,FALSE,no", "line 11.*quote"),
        (WINDY, "@attribute windy relational", "line 7.*relational"),
        (WINDY, "@attribute windy {TRUE, TRUE}", "line 7.*once"),
        (WINDY, "@attribute outlook {TRUE, FALSE}", "line 7.*outlook"),
        ("@data", "@rows", "@rows"),
    ],
)
def test_a_damaged_arff_file_is_told_with_its_line(weather, old, new, line):
    weather.write_text(WEATHER.replace(old, new, 1))
    with pytest.raises(DataDamaged, match=line):
        load_trials(str(weather))


@given(
    codes=st.lists(st.one_of(st.none(), st.integers(0, 3)), min_size=1, max_size=20),
    values=st.lists(st.text("ab= ,", min_size=1), min_size=4, max_size=4, unique=True),
)
def test_a_nominal_feature_is_found_again_in_its_columns(codes, values):
    columns = np.array([[np.nan] * 4 if k is None else [float(k == j) for j in range(4)] for k in codes])
    names = (*(value_name("colour", value) for value in values), "w")
    columns = np.column_stack([columns, np.arange(len(codes))])
    table = FeatureTable(names=names, units=("", "", "", "", "m"), values=columns)
    features, coded = with_codes(table)
    expected = [("colour", "", tuple(values)), ("w", "m", None)]
    assert [(nominal.name, nominal.unit, nominal.values) for nominal in features] == expected
    np.testing.assert_array_equal(coded[:, 0], [np.nan if k is None else k for k in codes])
    np.testing.assert_array_equal(codes_of(features, table), coded)


def test_numbers_with_an_equal_sign_in_their_name_stay_numbers():
    table = FeatureTable(names=("a=1", "a=2"), units=("m", ""), values=np.array([[0.5, 1.0], [1.0, 0.0]]))
    features, coded = with_codes(table)
    assert [nominal.name for nominal in features] == ["a=1", "a=2"]
    np.testing.assert_array_equal(coded, table.values)


def test_a_column_of_texts_can_be_named_and_left_out(tmp_path):
    path = shapes(tmp_path)
    colours = ("colour=blue", "colour=green", "colour=red")
    assert read_labelled(path, "what", features=["colour"]).table.names == colours
    assert read_labelled(path, "what", features=["weight"]).table.names == ("weight",)
    known = read_table(path, ["colour=red", "colour=green"])[0].values
    assert np.isnan(known[2]).all()  # blue is none of them
