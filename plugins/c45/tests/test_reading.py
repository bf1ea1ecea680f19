"""The tree to be read: text, rules, path, dot, drawing, JSON, importances."""

import json
import math
import re

import numpy as np
import pytest
from cases import every_case

from graspsense_c45 import (
    Attribute,
    Schema,
    StoredTreeError,
    draw,
    explain,
    feature_importances,
    fit,
    from_json,
    make_table,
    to_document,
    to_dot,
    to_json,
    to_rules,
    to_text,
)
from graspsense_c45.branch_words import weka_number, weka_weight


def grasp_tree():
    """delta_t (s) tells full from empty; among the full ones the material (nominal) tells open from closed."""
    delta_t = [0.2, 0.25, 0.3, 0.542] * 3 + [0.61, 0.7, 0.75, 0.8] * 4
    material = [0.0, 1.0, 2.0] * 4 + [0.0] * 8 + [1.0] * 6 + [2.0] * 2
    labels = [0] * 12 + [1] * 8 + [2] * 8
    schema = Schema(
        (Attribute("delta_t", "s"), Attribute("material", values=("can", "carton", "glass"))),
        ("empty", "full_open", "full_closed"),
    )
    return fit(make_table(schema, np.column_stack((delta_t, material)), labels))


def test_text():
    assert to_text(grasp_tree()) == (
        "\ndelta_t <= 0.542: empty (12.0)\ndelta_t > 0.542\n|   material = can: full_open (8.0)\n"
        "|   material = carton: full_closed (6.0)\n|   material = glass: full_closed (2.0)\n"
        "\nNumber of Leaves  : \t4\n\nSize of the tree : \t6\n"
    )


def test_path_in_words_and_units():
    path = explain(grasp_tree(), [0.61, 0.0])
    assert path.steps == ("delta_t 0.61 s > 0.542 s", "material = can")
    assert (path.label, path.probability, path.support) == ("full_open", 1.0, 8.0)
    assert str(path) == "full_open (1.00) because delta_t 0.61 s > 0.542 s and material = can"


def test_the_unit_of_a_ratio_is_not_printed():
    x, labels = np.arange(40.0)[:, None] / 40.0, (np.arange(40) >= 20) * 1
    tree = fit(make_table(Schema((Attribute("slope", unit="1"),), ("a", "b")), x, labels))
    assert explain(tree, [0.9]).steps == ("slope 0.9 > 0.475",)


def test_path_tells_close_numbers_apart_and_says_what_is_missing():
    assert explain(grasp_tree(), [0.5421, 0.0]).steps[0] == "delta_t 0.5421 s > 0.542 s"
    missing = explain(grasp_tree(), [math.nan, 2.0])
    assert missing.steps[0] == "delta_t missing (delta_t > 0.542 s in 57 % of training)"
    assert missing.probability == pytest.approx(16 / 28)


def test_rules_cover_every_leaf_with_support_and_probability():
    rules = to_rules(grasp_tree())
    assert [rule.label for rule in rules] == ["empty", "full_open", "full_closed", "full_closed"]
    assert rules[1].conditions == ("delta_t > 0.542 s", "material = can")
    assert str(rules[0]) == "if delta_t <= 0.542 s then empty (support 12, probability 1.00)"
    assert sum(rule.support for rule in rules) == 28.0


def test_rules_keep_the_tightest_bounds_only():
    x = np.arange(40.0)[:, None]
    labels = ((x[:, 0] >= 10) & (x[:, 0] < 20)) * 1 + ((x[:, 0] >= 20) & (x[:, 0] < 30)) * 2
    rules = to_rules(fit(make_table(Schema((Attribute("x"),), ("a", "b", "c")), x, labels)))
    assert {frozenset(rule.conditions) for rule in rules if rule.label == "b"} == {
        frozenset(("x > 9", "x <= 19"))
    }
    assert all(len(rule.conditions) <= 2 for rule in rules)


def test_dot_has_every_node_and_edge_and_quotes():
    tree = grasp_tree()
    dot = to_dot(tree)
    assert len(re.findall(r"^  n\d+ \[", dot, re.MULTILINE)) == tree.node_count
    assert len(re.findall(r"->", dot)) == tree.node_count - 1
    assert '[label="<= 0.542 s"]' in dot
    schema = Schema((Attribute('a "b"'),), ('"', "\\"))
    quoted = fit(make_table(schema, [[0.0]] * 3 + [[1.0]] * 3, [0] * 3 + [1] * 3))
    assert '[label="a \\"b\\""]' in to_dot(quoted)
    colours = Schema((Attribute("colour", values=("red", "green", "blue")),), ("a", "b", "c"))
    without_blue = fit(make_table(colours, [[0]] * 5 + [[1]] * 6, [1] * 5 + [2] * 6))
    assert 'n3 [label="c\\n0"' in to_dot(without_blue)


@pytest.mark.slow
def test_drawing_names_every_node():
    import matplotlib as mpl

    mpl.use("Agg")
    tree = grasp_tree()
    axes = draw(tree)
    words = [text.get_text() for text in axes.texts]
    assert len(words) == tree.node_count + tree.node_count - 1
    assert "delta_t" in words
    assert "empty\n12" in words
    mpl.pyplot.close("all")


def test_importances_share_the_information():
    # 28 rows: 1.557 bits in all, delta_t tells 0.985 (12 against 16), the material 16/28.
    importances = feature_importances(grasp_tree())
    gained = -(12 / 28 * math.log2(12 / 28) + 16 / 28 * math.log2(16 / 28))
    assert importances.tolist() == pytest.approx([gained / (gained + 16 / 28), 16 / 28 / (gained + 16 / 28)])
    leaf = fit(make_table(Schema((Attribute("x"),), ("a",)), [[1.0]], [0]))
    assert feature_importances(leaf).tolist() == [0.0]


def test_json_is_exact_and_says_its_version():
    tree = grasp_tree()
    document = to_document(tree)
    assert (document["format"], document["version"]) == ("graspsense-c45-tree", 1)
    assert from_json(to_json(tree)) == tree
    assert from_json(to_json(tree)).to_dict() == tree.to_dict()


@every_case(
    ("change", "words"),
    [
        ({"format": "x"}, "'format' must be"),
        ({"version": 2}, "reads 1"),
        ({"classes": [["a"], "b", "c"]}, "class label"),
        ({"classes": ["a"]}, "differ in length"),
        ({"nodes": {}}, "damaged"),
        ({"attributes": []}, "its attribute"),
    ],
)
def test_damaged_json_is_refused(change, words):
    with pytest.raises(StoredTreeError, match=words):
        from_json(json.dumps(to_document(grasp_tree()) | change))


@every_case("key", ["feature", "n_children", "category", "threshold", "class_weights"])
def test_damaged_nodes_are_refused(key):
    # Another number is a threshold too.
    for wrong in ("x", None) if key == "threshold" else (99, "x", -5, None):
        document = to_document(grasp_tree())
        document["nodes"][key][0] = wrong
        with pytest.raises(StoredTreeError):
            from_json(json.dumps(document))


UPWARDS = to_document(grasp_tree())
UPWARDS["nodes"]["n_children"] = [0, 2, 0, 3, 0, 0]


@every_case(
    ("text", "words"), [(to_json(grasp_tree())[:-3], "not JSON"), (json.dumps(UPWARDS), "form a tree")]
)
def test_text_that_is_no_tree_is_refused(text, words):
    with pytest.raises(StoredTreeError, match=words):
        from_json(text)


def test_numbers_as_weka_prints_them():
    numbers = (1.0, -0.25, 1e-9, 80282423097.21323, 2.5e15)
    assert [*map(weka_number, numbers)] == ["1", "-0.25", "0", "80282423097.21323", "2500000000000000"]
    assert [*map(weka_weight, (13.0, 2.125, 0.004, 12345678.0))] == ["13.0", "2.13", "0.0", "1.2345678E7"]
