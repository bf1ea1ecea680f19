"""CSV that we write: a spreadsheet finds no formula in it, and our own reader finds the texts that were written."""

import csv
import io
import itertools
import math
import re

import numpy as np
import pytest
from commands import graspsense
from hypothesis import given
from hypothesis import strategies as st
from kept import keep

from graspsense.core.files.csv_text import csv_text, text_of_cell
from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.features import FeatureTable
from graspsense.sources.trial_table.features_csv import read_labelled, write_labelled
from graspsense.store.dataset import labelled_store
from graspsense.store.store import Store

FORMULAS = [
    "=1+cmd|'/c calc'!A0",
    "+1+cmd|'/c calc'!A0",
    "-1+cmd|'/c calc'!A0",
    "@SUM(1)",
    "\t=1+1",
    "\r=1+1",
    "  =1+1",
    "'=1+1",
    "a;=1+1",
    "a\n=1+1",
    '"=1+1',
    'a;"=1+1',
    "\uff1d1+1",
]
"""Texts that a spreadsheet takes for a formula, some of them only if it divides cells at other characters."""


def cells_of(text, separator=","):
    return [cell for row in csv.reader(io.StringIO(text, newline=""), delimiter=separator) for cell in row]


NUMBER = re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?(,|$)")


def runs(cell):
    """Whether a spreadsheet takes a cell for a formula; a number is none, also where a comma does not divide cells."""
    starts = cell.lstrip().startswith(("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20"))
    return starts and NUMBER.match(cell) is None


@given(st.sampled_from(FORMULAS) | st.text(st.sampled_from("=+-@'\t\r\n;, ab1\"\uff1d")))
def test_every_text_is_read_back_and_none_is_a_formula_however_it_is_divided(text):
    (cell,) = [*cells_of(csv_text([[text]])), *([""] if text == "" else [])][:1]
    assert text_of_cell(cell) == text
    for separator in ",;\t":
        assert not any(map(runs, cells_of(csv_text([["label", text], [text, 1.5]]), separator)))


@given(st.floats())
def test_numbers_stay_numbers_of_the_same_bits(value):
    (row,) = csv.reader(io.StringIO(csv_text([[value, "x"]])))
    assert row[0] == ("" if math.isnan(value) else repr(value))
    for text in ("-3", "+1.5e-3", "-.5", "7."):  # so do texts that are numbers
        assert cells_of(csv_text([[text]])) == [text]


def labelled(labels):
    values = np.array([[-1.5, 2.0 + k % 3] for k in range(len(labels))])
    table = FeatureTable(names=("=f()", "-g"), units=("m", ""), values=values)
    return Labelled(source="x", table=table, labels=tuple(labels), order=tuple(range(len(labels))), notes=())


def test_a_table_of_features_is_harmless_and_is_read_back_as_it_was(tmp_path):
    labels = [*FORMULAS[:4], "a;=1+1", "plain"] * 3
    path = tmp_path / "features.csv"
    write_labelled(path, labelled(labels))
    assert not any(map(runs, cells_of(path.read_text())))
    back = read_labelled(path, label="label", order="order")
    assert list(back.labels) == labels
    assert back.table.names == ("=f()", "-g")
    assert (back.table.values == labelled(labels).table.values).all()


@pytest.fixture
def store(tmp_path):
    """Return a store with hostile labels, as an import of others' files can make one."""
    with Store.open(tmp_path / "t") as store:
        for label, value in itertools.product(FORMULAS[:4], (0.06, 0.07, 0.065)):
            keep(store, label, instance=f"{label}#1", values=(value, -5.5))
    return tmp_path / "t"


def test_an_exported_store_is_harmless_and_evaluates_as_the_store(store, tmp_path):
    out = tmp_path / "table.csv"
    assert graspsense("export", str(store), "--to", str(out)).returncode == 0
    cells = cells_of(out.read_text())
    assert not any(map(runs, cells))
    assert "'=1+cmd|'/c calc'!A0#1" in cells
    back, own = read_labelled(out, "label"), labelled_store(str(store))
    assert back.labels == own.labels
    assert back.instances == own.instances
    assert (back.table.values == own.table.values).all()


def test_a_label_forges_no_line_of_an_arff_file(tmp_path):
    with Store.open(tmp_path / "t") as store:
        for label in ("can\n1.0,2.0,forged", "a\r\n@data", "plain"):
            keep(store, label)
    out = tmp_path / "table.arff"
    assert graspsense("export", str(tmp_path / "t"), "--to", str(out)).returncode == 0
    data = out.read_bytes().split(b"@data\n")[-1].splitlines()
    assert len(data) == 3
    assert all(line.count(b",") >= 2 for line in data)
    assert out.read_bytes().count(b"\n@data") == 1
