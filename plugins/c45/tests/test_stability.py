"""Data that trees break on: each with what must come out."""

import numpy as np
import pytest
from attrs import evolve
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
    attributes = tuple(Attribute(f"x{i}") for i in range(values.shape[1]))
    return make_table(
        Schema(attributes, tuple(range(n_classes or int(max(labels)) + 1))), values, labels, weights
    )


def steps(*rows):
    """Return a table of one column: of each row so many copies with this label."""
    values, labels = ([each[i] for each in rows for _ in range(each[2])] for i in (0, 1))
    return table([[value] for value in values], labels)


def test_midpoint_of_two_huge_values_does_not_overflow():
    tree = fit(steps((1.6e308, 0, 4), (1.7e308, 1, 4)), Options(actual_split_value=False))
    assert 1.6e308 <= tree.to_dict()["threshold"] < 1.7e308
    assert tree.node_count == 3


def test_of_two_zeros_the_first_in_the_rows_is_the_threshold():
    # As J48; it is the one thing about a threshold that the order of the rows decides.
    for zero, opposite in ((0.0, -0.0), (-0.0, 0.0)):
        tree = fit(table([[zero], [opposite]] * 3 + [[1.0]] * 6, [0] * 6 + [1] * 6))
        assert np.signbit(tree.to_dict()["threshold"]) == np.signbit(zero)


@every_case(
    ("rows", "shares"),
    [
        (table([[0.0]] * 6, [2, 1, 2, 1, 2, 1]), [0.0, 0.5, 0.5]),
        (table([[1.0]], [0]), [1.0]),
        (table([[1.0], [2.0], [3.0]], [1, 1, 1], n_classes=3), [0.0, 1.0, 0.0]),
    ],
)
def test_few_rows_and_ties_have_an_answer(rows, shares):
    tree = fit(rows)
    assert distributions(tree, [[5.0]]).tolist() == [shares]
    # Of classes that are as frequent, the first is the answer.
    assert class_indices(tree, [[5.0]]).tolist() == [shares.index(max(shares))]


@every_case(
    ("values", "labels", "weights", "says"),
    [
        (np.zeros((0, 1)), [], None, "nothing to learn"),
        ([[1.0], [2.0]], [0, 1], [0.0, 0.0], "weight 0"),
        ([[1.0], [2.0]], [0, 1], [1.0, -1.0], "not negative"),
        ([[0.0], [1.0]], [0, 1], [1e308, 1e308], r"1e\+150"),
        ([[1.0], [np.inf], [2.0]], [0, 1, 0], None, "row 1, column x0"),
        ([[1.0], [-np.inf], [2.0]], [0, 1, 0], None, "row 1, column x0"),
    ],
)
def test_rows_that_nothing_can_be_learned_of_are_refused(values, labels, weights, says):
    with pytest.raises(ValueError, match=says):
        table(values, labels, weights, n_classes=2)


def test_infinite_values_have_no_answer():
    tree = fit(table([[0.0], [1.0]] * 4, [0, 1] * 4))
    for value in (np.inf, -np.inf):
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
    whole, any_number = st.integers(-3, 3).map(float), st.floats(-1e300, 1e300).map(lambda x: x + 0.0)
    cells = st.one_of(whole, st.just(float("nan")), any_number)
    rows, quarters = (
        st.lists(cells, min_size=n_columns, max_size=n_columns),
        st.integers(1, 12).map(lambda w: w / 4),
    )
    values, labels = (draw(st.lists(each, min_size=n, max_size=n)) for each in (rows, st.integers(0, 3)))
    weights = draw(st.one_of(st.none(), st.lists(quarters, min_size=n, max_size=n)))
    return table(values, labels, weights, n_classes=4)


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(tables(), st.randoms(use_true_random=False))
def test_the_order_of_the_rows_does_not_matter(given_table, random):
    order = list(range(len(given_table.labels)))
    random.shuffle(order)
    rows = (part[order] for part in (given_table.values, given_table.labels, given_table.weights))
    assert fit(given_table) == fit(Table(given_table.schema, *rows))


@pytest.mark.slow
@settings(max_examples=30, deadline=None)
@given(tables())
def test_weights_add_up_and_json_is_exact(given_table):
    tree = fit(given_table, Options(min_objects=1))
    assert tree.weighted_n_node_samples[0] == pytest.approx(given_table.weights.sum(), rel=1e-12)
    for node in range(tree.node_count):
        if children := list(tree.children(node)):
            shares = tree.class_weights[children].sum(axis=0)
            np.testing.assert_allclose(shares, tree.class_weights[node], atol=1e-6)
    assert from_json(to_json(tree)) == tree
    np.testing.assert_allclose(distributions(tree, given_table.values).sum(axis=1), 1.0, atol=1e-6)


def test_held_out_rows_need_reduced_error_pruning():
    held_out = Options(pruning="reduced_error")
    for options, rows, says in (
        (Options(), [0], "reduced_error"),
        (held_out, [0, 1], "all rows are held out"),
        (held_out, None, r"n_samples=2 .* 3 folds"),
    ):
        with pytest.raises(ValueError, match=says):
            fit(table([[0.0], [1.0]], [0, 1]), options, None if rows is None else np.array(rows))


OUT_OF_RANGE = {
    "criterion": "gini",
    "pruning": "x",
    "confidence_factor": 0.0,
    "min_objects": 0,
    "rep_folds": 1,
}


@every_case(("option", "value"), OUT_OF_RANGE.items())
def test_options_out_of_range_are_refused(option, value):
    with pytest.raises(ValueError, match=option):
        Options(**{option: value})


def test_a_deep_tree_is_no_trouble():
    # Classes that alternate along one column: a chain of cuts, hundreds of levels deep.
    n = 1_500
    labels = (np.arange(n) // 2) % 2
    tree = fit(table(np.arange(n)[:, None], labels), evolve(GROWN, min_objects=1))
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
