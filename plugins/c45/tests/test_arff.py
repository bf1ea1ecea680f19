"""ARFF files in."""

import numpy as np
import pytest
from cases import every_case

from graspsense_c45 import ArffError, fit, parse_arff, read_arff

HEAD = "@relation r\n@attribute 'a b' numeric\n@attribute c {x, 'y z', \"w,\\'v\"}\n@attribute class {no, yes}\n@data\n"


def test_dense_rows_with_quotes_missing_values_weights_and_comments():
    table = parse_arff("% top\n\n" + HEAD + "1.5,'y z',yes\n% between\n?, x , no, {2.5}\n-1e3,\"w,'v\",?\n")
    assert [a.name for a in table.schema.attributes] == ["a b", "c"]
    assert table.schema.attributes[1].values == ("x", "y z", "w,'v")
    assert table.schema.classes == ("no", "yes")
    np.testing.assert_array_equal(table.values, [[1.5, 1.0], [np.nan, 0.0], [-1000.0, 2.0]])
    assert table.labels.tolist() == [1, 0, -1]
    assert table.weights.tolist() == [1.0, 2.5, 1.0]


def test_sparse_rows_fill_in_zeros_and_first_values():
    table = parse_arff(HEAD + "{0 2.5, 2 yes}\n{1 'y z'}, {3}\n{}\n{0\t1, 1 'w,\\'v'}\n")
    assert table.values.tolist() == [[2.5, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0, 2.0]]
    assert table.labels.tolist() == [1, 0, 0, 0]
    assert table.weights.tolist() == [1.0, 3.0, 1.0, 1.0]


def test_a_question_mark_in_quotes_is_a_value():
    table = parse_arff("@relation r\n@attribute a {'?', b}\n@attribute c {x, y}\n@data\n'?',x\n?,y\nb,x\n")
    np.testing.assert_array_equal(table.values[:, 0], [0.0, np.nan, 1.0])


def test_the_class_may_be_any_nominal_attribute():
    table = parse_arff(HEAD + "1,x,yes\n", class_attribute="c")
    assert [a.name for a in table.schema.attributes] == ["a b", "class"]
    assert table.schema.classes == ("x", "y z", "w,'v")


def test_rows_without_a_class_are_not_learned_from_but_seen():
    # The midpoint is 2.5; the largest value below it is that of the row without a class.
    rows = "0,x,no\n1,x,no\n4,x,yes\n5,x,yes\n2.25,x,?\n"
    tree = fit(parse_arff(HEAD + rows))
    assert tree.to_dict()["threshold"] == 2.25
    assert tree.weighted_n_node_samples[0] == 4.0


@every_case(
    ("text", "words"),
    [
        ("hello\n", "<text>:1: found 'hello'"),
        (HEAD, "no rows after @data"),
        ("@relation r\n@data\n1\n", "without any @attribute"),
        ("@relation r\n@attribute a numeric\n", "no @data line"),
        ("@relation r\n@attribute a date\n@data\n", ":2: attribute 'a' is 'date'"),
        ("@relation r\n@attribute a {x,x}\n@data\n", "each once"),
        ("@relation r\n@attribute a {x\n@data\n", "end with }"),
        ("@relation r\n@attribute a numeric\n@data\n1\n", "the class 'a' is numeric"),
        (HEAD + "1,x\n", ":6: 2 values; there are 3 attributes"),
        (HEAD + "1,q,yes\n", "c is 'q'; declared: x"),
        (HEAD + "one,x,yes\n", "be a number"),
        (HEAD + "inf,x,yes\n", "infinite"),
        (HEAD + "1,x,yes,{heavy}\n", "'heavy'"),
        (HEAD + "1,x,yes,{-1}\n", "not negative"),
        (HEAD + "{7 1}\n", "sparse index '7'"),
        (HEAD + "1,,yes\n", "2 values; there are 3"),
        (HEAD + "1,'x,yes\n", "cannot read"),
    ],
)
def test_what_cannot_be_read_is_named(text, words):
    with pytest.raises(ArffError) as caught:
        parse_arff(text)
    assert words in str(caught.value)


def test_files(tmp_path):
    path = tmp_path / "rows.arff"
    path.write_text("\ufeff" + HEAD + "1,x,yes\n", encoding="utf-8")
    assert read_arff(path).labels.tolist() == [1]
    path.write_bytes(b"@relation \xff\n")
    with pytest.raises(ArffError, match="not UTF-8"):
        read_arff(path)
    with pytest.raises(ArffError, match="no attribute 'x'"):
        parse_arff(HEAD + "1,x,yes\n", class_attribute="x")
