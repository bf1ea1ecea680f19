import math
import re

import numpy as np
import pytest
from cases import every_case

from graspsense.core.learn.novelty import REACH, novelty_of
from graspsense.core.values.features import Features, FeatureTable
from graspsense.core.values.reasons import FeatureValue

NAMES, UNITS = ("p_first", "delta_t"), ("m", "s")


def table(rows):
    return FeatureTable(names=NAMES, units=UNITS, values=np.array(rows, dtype=np.float64))


def features(*values):
    reasons = {name: "the recording ended" for name, v in zip(NAMES, values, strict=True) if math.isnan(v)}
    return Features(names=NAMES, values=values, units=UNITS, reasons=reasons)


# Within classes p_first has the standard deviation 1 mm and delta_t 0.1 s.
ROWS = [[0.057, 0.2], [0.059, 0.4], [0.065, 0.5], [0.067, 0.7]]
SPAN = novelty_of(table(ROWS), ["bottle", "bottle", "can", "can"])


def test_the_edge_of_the_known_is_three_spreads_outside_a_class():
    assert SPAN.spread == pytest.approx([math.sqrt(2) * 1e-3, math.sqrt(2) * 0.1])
    assert not (SPAN.outside(table(ROWS)) > REACH).any()
    assert all(SPAN.unlike(features(*row)) is None for row in ROWS)
    for share in (0.99, 1.01):
        beyond = 0.067 + share * REACH * SPAN.spread[0]
        assert (SPAN.unlike(features(beyond, 0.6)) is not None) is (share > 1.0)
        assert (SPAN.outside(table([[beyond, 0.6]])) > REACH).tolist() == [share > 1.0]


def test_the_reason_names_the_feature_the_value_and_the_nearest_class_in_units():
    reason = SPAN.unlike(features(0.030, 0.3))
    assert re.fullmatch("p_first = 30 mm .* bottle, has 57 mm to 59 mm", reason.words)
    assert reason.features == (FeatureValue("p_first", 0.030, "m"),)


def test_a_missing_feature_is_not_judged_and_no_feature_at_all_is_unknown():
    assert SPAN.unlike(features(0.058, math.nan)) is None
    assert SPAN.unlike(features(0.030, math.nan)) is not None
    assert SPAN.unlike(features(math.nan, math.nan)).words.endswith(": the recording ended")
    assert SPAN.outside(table([[math.nan, math.nan]])).tolist() == [math.inf]


def test_trials_without_any_feature_are_known_where_a_class_has_such():
    span = novelty_of(table([*ROWS, [math.nan, math.nan]]), ["bottle", "bottle", "can", "can", "nothing"])

    assert span.unlike(features(math.nan, math.nan)) is None
    # The class without any range must not take in everything.
    assert span.unlike(features(0.030, 0.3)) is not None


@every_case(
    ("rows", "labels", "known", "unknown"),
    [
        # Like one class in one feature and another in the other.
        ([[0.0570, 0.2], [0.0571, 0.21], [0.067, 0.9], [0.0671, 0.91]], "aabb", (0.057, 0.2), (0.057, 0.9)),
        # A feature that was constant allows rounding only.
        ([[0.05, 0.2], [0.05, 0.3], [0.05, 0.4]], "aab", (0.05 * (1 + 1e-12), 0.3), (0.0501, 0.3)),
        # One trial a class is judged by what differs between classes.
        ([[0.05, 0.2], [0.06, 0.3]], "ab", (0.055, 0.25), (0.155, 0.25)),
    ],
)
def test_what_is_known_follows_from_the_classes(rows, labels, known, unknown):
    span = novelty_of(table(rows), list(labels))

    assert span.unlike(features(*known)) is None
    assert span.unlike(features(*unknown)) is not None
