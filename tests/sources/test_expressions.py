"""Expressions over columns: what they compute, and what they refuse with its place."""

import numpy as np
import pytest
from cases import every_case

from graspsense.sources.manifest.expression import ExpressionError, parse

COLUMNS = {
    "Pos": np.array([10.0, 20.0, 30.0]),
    "f1": np.array([1.0, 5.0, -2.0]),
    "f2": np.array([3.0, 4.0, 0.5]),
    "stamp ms": np.array([0.0, 1.0, 2.0]),
    "taxels": np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]),
}


def value(text):
    return parse(text).numbers(COLUMNS, 3).tolist()


@every_case(
    ("text", "expected"),
    [
        ("0.06 - Pos*0.001", [0.05, 0.04, 0.03]),
        ("max(f1, f2)", [3.0, 5.0, 0.5]),
        ("sum('f?')", [4.0, 9.0, -1.5]),
        ("mean(taxels)", [1.5, 3.5, 5.5]),
        ("norm(f1, f2)", [10.0**0.5, 41.0**0.5, 4.25**0.5]),
        ("-abs(f1)", [-1.0, -5.0, -2.0]),
        ("'stamp ms'/1000", [0.0, 0.001, 0.002]),
        ("Pos - first(Pos)", [0.0, 10.0, 20.0]),
        ("peak(f1)", [5.0, 5.0, 5.0]),
        ("sum(taxels*2)", [6.0, 14.0, 22.0]),
        ("sum(taxels - first(taxels))", [0.0, 4.0, 8.0]),
        ("7", [7.0, 7.0, 7.0]),
    ],
)
def test_a_value_is_that_of_arithmetic(text, expected):
    assert value(text) == pytest.approx(expected)


def test_the_unit_behind_an_expression_is_told_from_a_component():
    texts = ("60 - Pos  [mm] ", "force[2]", "force [2]", "'a [b]'", "F [m/s]")
    units = ("mm", "", "", "", "m/s")
    assert tuple(parse(text).unit for text in texts) == units
    assert parse(texts[0]).text == "60 - Pos"


@every_case(
    ("text", "says"),
    [
        ("0.06 - Poss*0.001", r"no column 'Poss'\. Columns: Pos, f1, f2, 'stamp ms', taxels.*'Pos'\?\n"),
        ("0.06 - Poss*0.001", r"    0\.06 - Poss\*0\.001\n           \^$"),
        ("sum('g*')", r"matches 'g\*'"),
        ("stamp ms*2", r"quotes: 'stamp ms'\*0.001"),
        ("max(Pos)", r"max .*first\(x\), last\(x\) and peak\(x\)"),
        ("taxels", "it gives 2 columns; fold them into one: sum, mean, max, min, norm"),
        ("taxels[2]", "component 2: it has 2, counted from 0"),
        ("median(f1, f2)", "median.*'mean'"),
        ("f1**2", r"there are \+ - \* /"),
        ("", "is empty: name a column"),
        ("abs(f1, f2)", "abs .*2"),
        ("True", "True is not"),
        ("-" * 90 + "f1", "nested too deep"),
    ],
)
def test_what_is_wrong_is_shown_with_its_place(text, says):
    with pytest.raises(ExpressionError, match=says):
        value(text)
