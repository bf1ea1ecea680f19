"""The interpreter and compiled code give the same tree, to the bit."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from graspsense_c45 import Attribute, Options, Schema, engines, fit, fitting, make_table
from graspsense_c45.engines import Fits

pytest.importorskip("numba", reason="the extra 'fast' (numba) is not installed: nothing is compiled")

OPTIONS: list[dict[str, Any]] = [
    {},
    {"pruning": "none"},
    {"pruning": "none", "collapse": False, "mdl_correction": False, "actual_split_value": False},
    {"confidence_factor": 0.05},
    {"confidence_factor": 0.6},
    {"min_objects": 1},
    {"min_objects": 7.5},
    {"subtree_raising": False},
    {"criterion": "info_gain"},
    {"criterion": "info_gain", "pruning": "reduced_error", "mdl_correction": False},
]


def schema_of(n_columns, n_classes):
    return Schema(tuple(Attribute(f"x{i}") for i in range(n_columns)), tuple(range(n_classes)))


def same_tree(table, options):
    """Return the tree of a table, which is the same of both engines."""
    plain, fast = (fit(table, Options(**options), engine=engine) for engine in ("plain", "fast"))
    assert plain == fast, options
    return plain


def grasps(seed, n, decimals, weights):
    rng = np.random.default_rng(seed)
    n_classes = int(rng.integers(2, 12))
    labels = rng.integers(0, n_classes, n)
    centres = rng.normal(0, 2, (n_classes, 5))
    values = centres[labels] + rng.uniform(0.5, 4) * rng.normal(0, 1, (n, 5))
    if decimals is not None:
        values = np.round(values, decimals)
    given = {"one": None, "whole": rng.integers(0, 4, n).astype(float), "any": rng.random(n) * 3}
    return make_table(schema_of(5, n_classes), values, labels, given[weights])


@pytest.mark.slow
@pytest.mark.parametrize("weights", ["one", "whole", "any"])
@pytest.mark.parametrize("decimals", [None, 0, 2])
def test_same_tree(weights, decimals):
    sizes = []
    for seed, options in enumerate(OPTIONS):
        table = grasps(seed, [40, 300, 1_500][seed % 3], decimals, weights)
        sizes.append(same_tree(table, options).node_count)
    assert max(sizes) > 50


@pytest.mark.slow
def test_same_tree_where_branches_are_raised_and_pruned_again():
    raised = 0
    for seed in range(8):
        table = grasps(seed, 2_000, 1, "one")
        raised += same_tree(table, {"min_objects": 1}) != fit(
            table, Options(min_objects=1, subtree_raising=False), engine="fast"
        )
    assert raised > 3


def nominal_and_missing(seed, missing):
    rng = np.random.default_rng(seed)
    numeric = grasps(seed, 400, 1, "any")
    codes = (numeric.labels[:, None] + rng.integers(0, 3, (400, 2))) % [3, 12]
    values = np.where(rng.random((400, 7)) < missing, np.nan, np.hstack((numeric.values, codes)))
    attributes = [Attribute(f"n{count}", values=tuple(map(str, range(count)))) for count in (3, 12)]
    schema = Schema((*numeric.schema.attributes, *attributes), numeric.schema.classes)
    return make_table(schema, values, numeric.labels, numeric.weights)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.0, 0.05, 0.6])
def test_same_tree_for_nominal_and_missing_values(missing):
    for seed, options in enumerate([*OPTIONS, {"binary_splits": True}]):
        table = nominal_and_missing(seed, missing)
        tree = same_tree(table, options)
        if "pruning" not in options:
            leaves = tree.class_weights[tree.splits.feature < 0]
            assert leaves.sum() == pytest.approx(table.weights.sum(), rel=1e-9)


ORACLE_TABLES = sorted((Path(__file__).parent / "weka" / "data").glob("*.csv"))


@pytest.mark.slow
@pytest.mark.parametrize("path", ORACLE_TABLES, ids=lambda path: path.stem)
def test_same_tree_on_the_awkward_sets(path):
    lines = [line.split(",") for line in path.read_text().splitlines()[1:] if line.startswith("train")]
    values = np.array([[float(cell.replace("?", "nan")) for cell in row[1:-2]] for row in lines])
    labels = np.array([int(row[-2]) for row in lines])
    weights = np.array([float(row[-1] or 1) for row in lines])
    table = make_table(schema_of(values.shape[1], labels.max() + 1), values, labels, weights)
    for options in OPTIONS:
        same_tree(table, options)


def test_many_small_fits_use_compiled_code_once_the_plain_form_took_as_long(monkeypatch):
    pytest.importorskip("graspsense")
    from graspsense_c45.building import compiled

    monkeypatch.delitem(sys.modules, "numba", raising=False)
    chosen = {}
    for on_disk in (True, False):
        monkeypatch.setattr(compiled, "kept", lambda slim, on_disk=on_disk: on_disk)
        fits, chosen[on_disk] = Fits(), []
        for _ in range(6):
            chosen[on_disk].append(fits.choose_fast("auto", 6_000, True))
            fits.add_plain(1.0)
        assert not fits.choose_fast("plain", 6_000, True)
    assert chosen == {True: [False] + 5 * [True], False: [k >= engines.COMPILING_S for k in range(6)]}


def test_a_tree_of_the_plain_form_counts(monkeypatch):
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    fits = Fits()
    monkeypatch.setattr(fitting, "_FITS", fits)
    monkeypatch.setattr(engines, "LOADING_S", 1e-9)
    monkeypatch.setattr(engines, "COMPILING_S", 1e-9)
    assert not fits.choose_fast("auto", 6_000, True)
    fit(grasps(1, 300, None, "one"))
    assert fits.choose_fast("auto", 6_000, True)
