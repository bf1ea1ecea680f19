"""The path through a tree as reasons: one range a feature, which accepts exactly what all the tests accept."""

import math
import re

import numpy as np
from attrs import evolve
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.learn.decision_path import SplitTest, path_reasons
from graspsense.core.values.features import Features, FeatureTable, Prediction
from graspsense.core.values.units import in_words_apart
from graspsense.plugin_api import create

NUMBERS = st.floats(-1e3, 1e3) | st.sampled_from([0.0569, 0.057, 0.0570001])


@given(tests=st.lists(st.tuples(st.sampled_from("abc"), NUMBERS), max_size=12), value=NUMBERS, other=NUMBERS)
def test_the_ranges_accept_exactly_what_all_the_tests_accept(tests, value, other):
    path = [
        SplitTest(feature=name, unit="m", value=value, threshold=threshold, above=value > threshold)
        for name, threshold in tests
    ]
    reasons = {reason.features[0].name: reason for reason in path_reasons(path)}

    for name, reason in reasons.items():
        low, high = (-math.inf if reason.above is None else reason.above), reason.up_to
        accepted = all((other > test.threshold) == test.above for test in path if test.feature == name)
        assert (low < other <= (math.inf if high is None else high)) == accepted
    assert reasons.keys() == {name for name, _ in tests}


@given(values=st.lists(NUMBERS, min_size=1, max_size=4))
def test_different_values_read_differently_and_in_order(values):
    texts = in_words_apart(sorted(values), "m")

    read = [float(re.fullmatch(r"(\S+) mm", text)[1]) for text in texts]
    assert read == sorted(read)
    assert len(set(read)) == len({1e3 * value for value in values})


def test_the_tightest_bound_is_told_with_the_unit_for_people():
    def test(threshold, above):
        return SplitTest(feature="p_first", unit="m", value=0.0579, threshold=threshold, above=above)

    (above,) = path_reasons([test(0.0569, True), test(0.057, True)])
    assert above.words == "p_first = 57.9 mm > 57 mm"
    assert (above.features[0].value, above.above, above.up_to) == (0.0579, 0.057, None)
    (between,) = path_reasons([test(0.0569, True), test(0.0599, False)])
    assert between.words == "56.9 mm < p_first = 57.9 mm <= 59.9 mm"
    (below,) = path_reasons([SplitTest(feature="f", unit="1", value=0.5, threshold=0.50001, above=False)])
    assert below.words == "f = 0.5 <= 0.50001"


def test_a_share_of_training_trials_is_no_certainty():
    shares = {"x": 1.0, "y": 0.0}
    counted = Prediction(label="x", probabilities=shares, because=("r",), support=(6.0, 6.0))
    elsewhere = evolve(counted, no_certainty="another force")
    measured = evolve(counted, probabilities={"x": 0.45, "y": 0.55}, calibrated=True)

    assert (counted.certainty, counted.certainty_in_words) == (None, "6 of 6 training trials")
    assert elsewhere.certainty_in_words == "6 of 6 training trials; no certainty: another force"
    assert measured.certainty_in_words == "about 45 %: 6 of 6 training trials"
    assert evolve(measured, support=None).certainty_in_words == "about 45 %"
    assert evolve(measured, probabilities=shares, support=None).certainty_in_words == "over 99 %"
    assert Prediction(label="unknown", probabilities={"x": 1.0}, because=("r",)).certainty_in_words == ""


@every_case(("name", "settings"), [("c45", {}), ("tree", {}), ("knn", {"neighbours": 4})])
def test_classifiers_that_count_training_trials_say_how_many(name, settings):
    values = np.array([[0.01], [0.011], [0.012], [0.013], [0.05], [0.051], [0.052], [0.053]])
    classifier = create("classifier", name, **settings)
    classifier.fit(FeatureTable(names=("a",), units=("m",), values=values), ["x"] * 4 + ["y"] * 4, 0)
    said = classifier.explain(Features(names=("a",), values=(0.0515,), units=("m",)))
    assert (said.label, said.support, said.certainty) == ("y", (4.0, 4.0), None)
    assert max(said.probabilities.values()) == 1.0
