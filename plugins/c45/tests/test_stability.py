"""Data that trees break on: each with what must come out."""

import numpy as np
import pytest
from cases import every_case
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense_c45 import (
    Attribute,
    Options,
    Schema,
    Table,
    class_indices,
    distributions,
    fit,
    from_json,
    make_table,
    to_json,
)

GROWN = Options(pruning="none", collapse=False, mdl_correction=False)


def table(values, labels, weights=None, n_classes=None):
    values = np.asarray(values, dtype=float)
    classes = tuple(range(n_classes or int(max(labels)) + 1))
    return make_table(
        Schema(tuple(Attribute(f"x{i}") for i in range(values.shape[1])), classes), values, labels, weights
    )


def test_midpoint_of_two_huge_values_does_not_overflow():
    tree = fit(table([[1.6e308]] * 4 + [[1.7e308]] * 4, [0] * 4 + [1] * 4), Options(actual_split_value=False))
    assert 1.6e308 <= tree.to_dict()["threshold"] < 1.7e308
    assert tree.node_count == 3


def test_a_column_below_the_gap_never_splits():
    # J48's rule: neighbours must differ by more than 1e-5, whatever the scale.
    for tiny in (1e-300, 1e-9, 0.99e-5):
        assert fit(table([[0.0]] * 5 + [[tiny]] * 5, [0] * 5 + [1] * 5), GROWN).node_count == 1
    assert fit(table([[0.0]] * 5 + [[1.1e-5]] * 5, [0] * 5 + [1] * 5), GROWN).node_count == 3


def test_of_two_zeros_the_first_in_the_rows_is_the_threshold():
    # As J48; it is the one thing about a threshold that the order of the rows decides.
    for zero, opposite in ((0.0, -0.0), (-0.0, 0.0)):
        tree = fit(table([[zero], [opposite]] * 3 + [[1.0]] * 6, [0] * 6 + [1] * 6))
        assert np.signbit(tree.to_dict()["threshold"]) == np.signbit(zero)


def test_majority_ties_go_to_the_first_class():
    tree = fit(table([[0.0]] * 6, [2, 1, 2, 1, 2, 1]))
    assert class_indices(tree, [[5.0]]).tolist() == [1]
    assert distributions(tree, [[5.0]]).tolist() == [[0.0, 0.5, 0.5]]


def test_one_row_and_one_class():
    assert class_indices(fit(table([[1.0]], [0])), [[7.0]]).tolist() == [0]
    tree = fit(table([[1.0], [2.0], [3.0]], [1, 1, 1], n_classes=3))
    assert distributions(tree, [[2.0]]).tolist() == [[0.0, 1.0, 0.0]]


def test_no_row_and_no_weight_are_refused():
    schema = Schema((Attribute("x"),), (0, 1))
    with pytest.raises(ValueError, match="nothing to learn"):
        make_table(schema, np.zeros((0, 1)), [])
    with pytest.raises(ValueError, match="weight 0"):
        make_table(schema, [[1.0], [2.0]], [0, 1], [0.0, 0.0])
    with pytest.raises(ValueError, match="not negative"):
        make_table(schema, [[1.0], [2.0]], [0, 1], [1.0, -1.0])


def test_rows_of_weight_zero_do_not_vote():
    values = [[0.0]] * 4 + [[1.0]] * 4 + [[0.0]] * 3
    weights = [1.0] * 8 + [0.0] * 3
    tree = fit(table(values, [0] * 4 + [1] * 4 + [1] * 3, weights))
    assert tree.class_weights.tolist() == [[4.0, 4.0], [4.0, 0.0], [0.0, 4.0]]


def test_whole_weights_are_repeated_rows():
    rng = np.random.default_rng(0)
    labels = rng.integers(0, 3, 60)
    values = labels[:, None] + rng.normal(0, 0.8, (60, 2))
    weights = rng.integers(1, 4, 60)
    # With the least minimum, since J48 asks for twice that many rows, and counts them unweighted.
    options = Options(min_objects=1)
    weighted = fit(table(values, labels, weights), options)
    repeated = fit(table(np.repeat(values, weights, axis=0), np.repeat(labels, weights)), options)
    assert weighted == repeated
    assert weighted.node_count > 1


@pytest.mark.parametrize("value", [np.inf, -np.inf])
def test_infinite_values_are_refused(value):
    with pytest.raises(ValueError, match="row 1, column x0"):
        table([[1.0], [value], [2.0]], [0, 1, 0])
    tree = fit(table([[0.0], [1.0]] * 4, [0, 1] * 4))
    with pytest.raises(ValueError, match="infinite"):
        class_indices(tree, [[value]])


def test_a_column_that_is_all_missing_is_left_alone():
    values = np.column_stack((np.full(8, np.nan), [0.0] * 4 + [1.0] * 4))
    tree = fit(table(values, [0] * 4 + [1] * 4))
    assert tree.to_dict()["feature"] == 1
    assert fit(table(np.full((6, 1), np.nan), [0, 1] * 3)).node_count == 1


def test_a_value_no_row_took_answers_with_the_parents_distribution():
    schema = Schema((Attribute("colour", values=("red", "green", "blue")),), (0, 1))
    tree = fit(make_table(schema, [[0.0]] * 4 + [[1.0]] * 3, [0] * 4 + [1] * 3), GROWN)
    assert tree.node_count == 4
    assert distributions(tree, [[2.0]])[0].tolist() == pytest.approx([4 / 7, 3 / 7])


def test_many_values_stay_out_of_the_average_but_may_be_chosen():
    # A nominal column with a value for every pair of rows: at 0.3 n values or more it does not raise the average gain.
    values = np.column_stack((np.repeat(np.arange(10.0), 2), [0.0] * 9 + [1.0] * 11))
    schema = Schema((Attribute("id", values=tuple("abcdefghij")), Attribute("x")), (0, 1))
    tree = fit(make_table(schema, values, [0] * 10 + [1] * 10), GROWN)
    assert tree.to_dict()["feature"] == 1


def test_a_nominal_column_must_hold_indices():
    schema = Schema((Attribute("colour", values=("red", "green")),), (0, 1))
    for wrong in (2.0, -1.0, 0.5):
        with pytest.raises(ValueError, match="colour"):
            make_table(schema, [[0.0], [wrong]], [0, 1])


@st.composite
def tables(draw):
    n = draw(st.integers(1, 40))
    n_columns = draw(st.integers(1, 3))
    cells = st.one_of(
        st.integers(-3, 3).map(float), st.just(float("nan")), st.floats(-1e300, 1e300).map(lambda x: x + 0.0)
    )
    values = draw(st.lists(st.lists(cells, min_size=n_columns, max_size=n_columns), min_size=n, max_size=n))
    labels = draw(st.lists(st.integers(0, 3), min_size=n, max_size=n))
    weights = draw(
        st.one_of(st.none(), st.lists(st.integers(1, 12).map(lambda w: w / 4), min_size=n, max_size=n))
    )
    return table(values, labels, weights, n_classes=4)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(tables(), st.randoms(use_true_random=False))
def test_the_order_of_the_rows_does_not_matter(given_table, random):
    order = list(range(len(given_table.labels)))
    random.shuffle(order)
    shuffled = Table(
        given_table.schema, given_table.values[order], given_table.labels[order], given_table.weights[order]
    )
    assert fit(given_table) == fit(shuffled)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(tables())
def test_weights_add_up_and_json_is_exact(given_table):
    tree = fit(given_table, Options(min_objects=1))
    assert tree.weighted_n_node_samples[0] == pytest.approx(given_table.weights.sum(), rel=1e-12)
    for node in range(tree.node_count):
        children = list(tree.children(node))
        if children:
            np.testing.assert_allclose(
                tree.class_weights[children].sum(axis=0), tree.class_weights[node], atol=1e-6
            )
    assert from_json(to_json(tree)) == tree
    np.testing.assert_allclose(distributions(tree, given_table.values).sum(axis=1), 1.0, atol=1e-6)


def test_the_order_of_the_columns_matters_in_ties_only():
    rng = np.random.default_rng(5)
    labels = rng.integers(0, 3, 200)
    values = labels[:, None] * [0.5, 0.9, 1.3] + rng.normal(0, 1, (200, 3))
    options = Options(min_objects=8)
    straight = fit(table(values, labels), options).to_dict()
    turned = fit(table(values[:, ::-1], labels), options).to_dict()
    pairs = [(straight, turned)]
    compared = 0
    while pairs:
        node, other = pairs.pop()
        assert node["class_weights"] == other["class_weights"]
        if "feature" in node:
            assert (node["feature"], node["threshold"]) == (2 - other["feature"], other["threshold"])
            pairs += list(zip(node["children"], other["children"], strict=True))
            compared += 1
    assert compared >= 3


def test_the_order_of_the_rows_decides_what_is_held_out():
    # Reduced-error pruning holds rows out by their place, as J48 does.
    rng = np.random.default_rng(2)
    labels = rng.integers(0, 2, 90)
    values = labels[:, None] + rng.normal(0, 1.5, (90, 2))
    trees = [
        fit(table(values[order], labels[order]), Options(pruning="reduced_error"))
        for order in (np.arange(90), rng.permutation(90))
    ]
    assert trees[0] != trees[1]
    assert trees[0].weighted_n_node_samples[0] == 60.0


def test_held_out_rows_need_reduced_error_pruning():
    with pytest.raises(ValueError, match="reduced_error"):
        fit(table([[0.0], [1.0]], [0, 1]), Options(), np.array([0]))
    with pytest.raises(ValueError, match="all rows are held out"):
        fit(table([[0.0], [1.0]], [0, 1]), Options(pruning="reduced_error"), np.array([0, 1]))
    with pytest.raises(ValueError, match=r"n_samples=2 .* 3 folds"):
        fit(table([[0.0], [1.0]], [0, 1]), Options(pruning="reduced_error"))


@every_case(
    ("option", "value"),
    [
        ("criterion", "gini"),
        ("pruning", "x"),
        ("confidence_factor", 0.0),
        ("min_objects", 0),
        ("rep_folds", 1),
    ],
)
def test_options_out_of_range_are_refused(option, value):
    with pytest.raises(ValueError, match=option):
        Options(**{option: value})


def test_a_deep_tree_is_no_trouble():
    # Classes that alternate along one column: a chain of cuts, hundreds of levels deep.
    n = 1_500
    labels = (np.arange(n) // 2) % 2
    options = Options(pruning="none", collapse=False, mdl_correction=False, min_objects=1)
    values = np.arange(n, dtype=float)[:, None] ** 1.0
    tree = fit(table(values, labels), options)
    assert tree.node_count > 100
    assert from_json(to_json(tree)) == tree


@pytest.mark.filterwarnings("error::RuntimeWarning")
@every_case("factor", [5e-324, 1e-300, 1e-12, 1e-10, 1e-9, 1e-6, 1e-3, 1.0, 1e9, 1e140])
@every_case("missing", [False, True])
def test_weights_of_any_size_give_a_tree(factor, missing):
    values = [[float(i)] for i in range(12)]
    if missing:
        values[5] = [float("nan")]
    weighted = table(values, [0] * 6 + [1] * 6, [factor] * 12)
    tree = fit(weighted)
    assert distributions(tree, values).sum(axis=1) == pytest.approx(np.ones(12))
    if factor < 1:  # J48 splits only nodes of at least twice min_objects
        assert tree.node_count == 1
    assert from_json(to_json(tree)) == tree


def test_weights_that_overflow_are_refused():
    with pytest.raises(ValueError, match=r"1e\+150"):
        table([[0.0], [1.0]], [0, 1], [1e308, 1e308])
