"""J48's own answers, option set by option set; see README.md here for their origin."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from cases import every_case

from graspsense_c45 import (
    Attribute,
    Options,
    Schema,
    Table,
    class_indices,
    distributions,
    fit,
    hold_out,
    make_table,
    read_arff,
    stratified_folds,
    to_text,
)

WEKA = Path(__file__).parent / "weka"

VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "unpruned": {"pruning": "none"},
    "unpruned_nocollapse": {"pruning": "none", "collapse": False},
    "nocollapse": {"collapse": False},
    "cf05": {"confidence_factor": 0.05},
    "cf10": {"confidence_factor": 0.1},
    "cf50": {"confidence_factor": 0.5},
    "m1": {"min_objects": 1},
    "m5": {"min_objects": 5},
    "m10": {"min_objects": 10},
    "rep": {"pruning": "reduced_error"},
    "rep_q7": {"pruning": "reduced_error"},
    "rep_n10": {"pruning": "reduced_error", "rep_folds": 10},
    "laplace": {"laplace": True},
    "noraise": {"subtree_raising": False},
    "binary": {"binary_splits": True},
    "nomdl": {"mdl_correction": False},
    "midpoint": {"actual_split_value": False},
    "unpruned_nomdl_midpoint": {
        "pruning": "none", "collapse": False, "mdl_correction": False, "actual_split_value": False,
    },
}  # fmt: skip
SETS = sorted(path.stem for path in (WEKA / "oracle").glob("*.json"))
FOR_CV = ["default", "rep", "unpruned_nomdl_midpoint", "binary", "laplace"]
"""The tree of the whole table is compared in every variant."""
SMALL = ["arff_contact-lenses", "grasp_4c_40", "sk_iris", "ulps", "xor"]
WITH_CV = [name for name in SETS if name != "arff_weather.nominal"]


class Asked(NamedTuple):
    table: Table
    probe: np.ndarray | None
    oracle: dict[str, Any]

    def answer(self, variant, key):
        given = self.oracle["variants"][variant].get(key)
        while isinstance(given, dict) and "same_as" in given:
            given = self.oracle["variants"][given["same_as"]].get(key)
        return given


@cache
def asked(name):
    oracle = json.loads((WEKA / "oracle" / f"{name}.json").read_text())
    if name.startswith("arff_"):
        table = read_arff(WEKA / "arff" / f"{name.removeprefix('arff_')}.arff")
        assert list(table.schema.classes) == oracle["classes"]
        return Asked(table, None, oracle)
    if name.startswith("sk_"):
        from sklearn import datasets

        given = getattr(datasets, f"load_{name.removeprefix('sk_')}")()
        return Asked(as_table(given.data, given.target, None, oracle["classes"]), None, oracle)
    return Asked(*read_csv(name, oracle["classes"]), oracle)


@cache
def fitted(name, variant):
    return fit(asked(name).table, Options(**VARIANTS[variant]))


def as_table(values, labels, weights, classes):
    attributes = tuple(Attribute(f"x{i}") for i in range(np.shape(values)[1]))
    return make_table(Schema(attributes, tuple(classes)), values, labels, weights)


def read_csv(name, classes=None):
    lines = (WEKA / "data" / f"{name}.csv").read_text().splitlines()[1:]
    cells = [line.split(",") for line in lines]
    train, probe = ([row for row in cells if row[0] == part] for part in ("train", "probe"))

    def numbers(rows):
        return np.array([[float(cell.replace("?", "nan")) for cell in row[1:-2]] for row in rows])

    labels = [int(row[-2]) for row in train]
    weights = [float(row[-1] or 1) for row in train]
    classes = range(max(labels) + 1) if classes is None else classes
    return as_table(numbers(train), labels, weights, classes), numbers(probe)


def assert_same_nodes(ours, theirs, where):
    pairs = [(ours, theirs, where)]
    while pairs:
        mine, given, place = pairs.pop()
        assert mine.get("feature") == given.get("att"), place
        assert mine.get("threshold") == given.get("thr"), place
        assert mine["class"] == given["class"], place
        assert mine["weighted_n_node_samples"] == pytest.approx(given["n"], abs=1e-6), place
        assert mine["class_weights"] == pytest.approx(given["dist"], abs=1e-6), place
        if "att" in given:
            assert mine["child_weights"] == pytest.approx(given["bags"], abs=1e-6), place
            assert len(mine["children"]) == len(given["children"]), place
            children = zip(mine["children"], given["children"], strict=True)
            pairs += [(m, g, f"{place}.{i}") for i, (m, g) in enumerate(children)]


def assert_same_answers(tree, question, variant):
    compared = 0
    for part, rows in (("resub", question.table.values), ("probe", question.probe)):
        predicted = question.answer(variant, f"{part}_pred")
        if rows is not None and predicted is not None:
            assert class_indices(tree, rows).tolist() == predicted, (variant, part)
            compared += 1
        shares = question.answer(variant, f"{part}_dist")
        if rows is not None and shares is not None:
            np.testing.assert_allclose(distributions(tree, rows), shares, rtol=0, atol=1e-9)
            compared += 1
    return compared


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_trees_and_answers(name):
    question = asked(name)
    assert set(question.oracle["variants"]) == set(VARIANTS)
    for variant in VARIANTS:
        tree = fitted(name, variant)
        assert_same_nodes(tree.to_dict(), question.answer(variant, "tree"), f"{name} {variant}")
        assert assert_same_answers(tree, question, variant) >= 1
        assert tree.node_count == question.answer(variant, "size")
        assert tree.n_leaves == question.answer(variant, "leaves")


@pytest.mark.parametrize("sets", [SMALL, pytest.param(SETS, marks=pytest.mark.slow)], ids=["small", "all"])
def test_text_is_j48s(sets):
    for name in sets:
        question = asked(name)
        texts = {variant: question.answer(variant, "text") for variant in VARIANTS}
        assert any(texts.values())
        for variant, text in texts.items():
            if text is not None and isinstance(question.table.schema.classes[0], str):
                body = text.split("------------------\n", 1)[1]
                assert to_text(fitted(name, variant)) == body, (name, variant)


@every_case("name", SETS)
def test_held_out_rows_are_j48s(name):
    question = asked(name)
    assert sorted(hold_out(question.table.labels, 3).tolist()) == sorted(question.oracle["rep_holdout_N3"])


def check_cross_validation(name, variants):
    question, compared = asked(name), 0
    table, folds = question.table, stratified_folds(question.table.labels)
    for variant in variants:
        theirs = question.oracle["variants"][variant].get("cv")
        if theirs is None:
            continue
        confusion = np.zeros((len(table.schema.classes),) * 2, dtype=int)
        predicted, sizes = np.full(len(table.labels), -1), []
        for train, test in folds:
            rows = (part[train] for part in (table.values, table.labels, table.weights))
            tree = fit(make_table(table.schema, *rows), Options(**VARIANTS[variant]))
            predicted[test] = distributions(tree, table.values[test]).argmax(axis=1)
            sizes.append(tree.node_count)
        np.add.at(confusion, (table.labels, predicted), 1)
        assert confusion.tolist() == theirs["confusion"], (name, variant)
        assert predicted.tolist() == theirs["pred"], (name, variant)
        assert sizes == theirs["tree_sizes"], (name, variant)
        compared += 1
    return compared


@every_case("name", WITH_CV)
def test_folds_are_wekas(name):
    question = asked(name)
    folds = stratified_folds(question.table.labels)
    assert [fold.test.tolist() for fold in folds] == question.oracle["folds"]["test"]
    if "train_order" in question.oracle["folds"]:
        assert [fold.train.tolist() for fold in folds] == question.oracle["folds"]["train_order"]


@pytest.mark.parametrize(
    ("names", "variants"),
    [
        pytest.param(SMALL, ["default", "rep"], id="small sets"),
        pytest.param(WITH_CV, FOR_CV, id="one of each pruning", marks=pytest.mark.slow),
        pytest.param(WITH_CV, list(VARIANTS), id="all", marks=pytest.mark.long),
    ],
)
def test_cross_validation(names, variants):
    for name in names:
        assert check_cross_validation(name, variants) >= 1


def test_where_j48_never_ends_ours_does():
    # (lo + hi) / 2 overflows there; J48 then sends every row left, again and again.
    table, probe = read_csv("mag_overflow")
    tree = fit(table, Options(pruning="none"))
    inner = tree.splits.feature >= 0
    assert np.isfinite(tree.splits.threshold[inner]).all()
    for node in np.flatnonzero(inner).tolist():
        assert all(tree.weighted_n_node_samples[child] > 0 for child in tree.children(node))
    assert len(class_indices(tree, probe)) == len(probe)
    assert np.abs(table.values).max() > 8e307
