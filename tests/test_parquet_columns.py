"""What becomes of each type of column of a Parquet file: numbers, several numbers a row, an image a row, or texts."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

pyarrow = pytest.importorskip("pyarrow", reason="needs the extra parquet")
pq = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")

from graspsense.sources.manifest.parquet_format import read_parquet  # noqa: E402

NAN = float("nan")
COLUMNS = {
    "double": (pyarrow.array([1.5, None, 2.5]), [1.5, NAN, 2.5]),
    "integer": (pyarrow.array([1, None, 3], pyarrow.int16()), [1.0, NAN, 3.0]),
    "unsigned": (pyarrow.array([2**63, 0, 1], pyarrow.uint64()), [2.0**63, 0.0, 1.0]),
    "half": (pyarrow.array(np.float16([0.5, 1.5, 2.5])), [0.5, 1.5, 2.5]),
    "logical": (pyarrow.array([True, None, False]), [1.0, NAN, 0.0]),
    "nothing": (pyarrow.nulls(3), [NAN, NAN, NAN]),
    "written": (pyarrow.array(["1.5", None, "-2"]), [1.5, NAN, -2.0]),
    "pairs": (pyarrow.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]),
    "single": (pyarrow.array([[1.0], [2.0], [3.0]]), [1.0, 2.0, 3.0]),
    "fixed": (
        pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(np.arange(6.0)), 2),
        [[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]],
    ),
    "image": (pyarrow.array([[[1.0, 2.0], [3.0, 4.0]]] * 3), [[1.0, 2.0, 3.0, 4.0]] * 3),
    "text": (pyarrow.array(["jar", None, "can"]), ["jar", "", "can"]),
    "category": (pyarrow.array(["a", "b", "a"]).dictionary_encode(), ["a", "b", "a"]),
    "ragged": (pyarrow.array([[1.0], [1.0, 2.0], []]), ["[1.0]", "[1.0, 2.0]", "[]"]),
    "missing": (pyarrow.array([[1.0], None, [2.0]]), [1.0, NAN, 2.0]),
    "table": (pyarrow.array([{"a": 1}] * 3), ["{'a': 1}"] * 3),
    "day": (pyarrow.array([datetime.date(2024, 11, 24)] * 3), ["2024-11-24"] * 3),
}


@pytest.mark.parametrize("rows_of_a_group", [1, 3])
def test_columns(tmp_path, rows_of_a_group):
    path = tmp_path / "a.parquet"
    table = pyarrow.table({name: column for name, (column, _) in COLUMNS.items()})
    pq.write_table(table, path, row_group_size=rows_of_a_group)
    (found,) = read_parquet(path)
    assert len(found) == 3
    for name, (_, expected) in COLUMNS.items():
        if isinstance(expected[0], str):
            assert list(found.texts[name]) == expected
        else:
            np.testing.assert_array_equal(found.numbers[name], expected)
    assert found.shapes == {"image": (2, 2)}
