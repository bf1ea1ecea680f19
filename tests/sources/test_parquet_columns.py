"""What becomes of each type of column of a Parquet file: numbers, several numbers a row, an image a row, or texts."""

import datetime
from contextlib import suppress

import numpy as np
import pytest
from cases import every_case

pyarrow = pytest.importorskip("pyarrow", reason="needs the extra parquet")
pq = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")

from graspsense.core.values.errors import DataDamaged  # noqa: E402
from graspsense.sources.formats.parquet_footer import parquet_size  # noqa: E402
from graspsense.sources.formats.parquet_format import read_parquet  # noqa: E402

NAN = float("nan")
COLUMNS = {
    "double": (pyarrow.array([1.5, None, 2.5]), [1.5, NAN, 2.5]),
    "unsigned": (pyarrow.array([2**63, 0, 1], pyarrow.uint64()), [2.0**63, 0.0, 1.0]),
    "half": (pyarrow.array(np.float16([0.5, 1.5, 2.5])), [0.5, 1.5, 2.5]),
    "logical": (pyarrow.array([True, None, False]), [1.0, NAN, 0.0]),
    "nothing": (pyarrow.nulls(3), [NAN, NAN, NAN]),
    "written": (pyarrow.array(["1.5", None, "-2"]), [1.5, NAN, -2.0]),
    "half known": (pyarrow.array([[1, None], [3, 4], [None, None]]), [[1.0, NAN], [3.0, 4.0], [NAN, NAN]]),
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


@every_case("rows_of_a_group", [1, 2, 3])
def test_columns_and_the_footer_are_what_pyarrow_says(tmp_path, rows_of_a_group):
    path = tmp_path / "a.parquet"
    table = pyarrow.table({name: column for name, (column, _) in COLUMNS.items()})
    pq.write_table(table, path, row_group_size=rows_of_a_group)
    (columns,) = read_parquet(path)
    assert len(columns) == 3
    for name, (_, expected) in COLUMNS.items():
        if isinstance(expected[0], str):
            assert list(columns.texts[name]) == expected
        else:
            np.testing.assert_array_equal(columns.numbers[name], expected)
    assert columns.shapes == {"image": (2, 2)}

    metadata, size = pq.read_metadata(path), parquet_size(path)
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    chunks = [group.column(k) for group in groups for k in range(metadata.num_columns)]
    assert size.rows == 3
    assert size.values == sum(chunk.num_values for chunk in chunks)
    assert size.unpacked_bytes == sum(chunk.total_uncompressed_size for chunk in chunks)


@every_case("position", range(20, 400, 7))
def test_a_damaged_footer_is_told_and_never_ends_the_process(position, tmp_path):
    """pyarrow calls abort for some of these when it is asked for a column of its metadata."""
    path = tmp_path / "a.parquet"
    pq.write_table(pyarrow.table({"a": [[1.0, 2.0], [3.0, 4.0]], "b": ["x", "y"]}), path)
    data = bytearray(path.read_bytes())
    data[-position] ^= 0x15
    path.write_bytes(data)
    with suppress(DataDamaged):
        assert len(read_parquet(path)[0]) <= 2
