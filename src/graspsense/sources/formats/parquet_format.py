"""Parquet files as tables, read by pyarrow within the limit on what a file may unpack to.

Repeated values take almost no place in a Parquet file. So its numbers of rows and values count, not its bytes.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspsense.core.values.errors import PluginUnavailable
from graspsense.core.values.written_numbers import NotNumbers, columns_of_numbers
from graspsense.core.values.written_times import seconds_since_first
from graspsense.recording.parquet import PARQUET_HINT
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.formats.parquet_footer import parquet_size
from graspsense.sources.formats.table import ColumnTable, Numbers

_BYTES_OF_A_NUMBER: Final = 8
_BYTES_OF_A_TEXT: Final = 64
_ROWS_AT_ONCE: Final = 65536


def read_parquet(path: Path, wanted: Collection[str] | None = None) -> list[ColumnTable]:
    """Return the table in a Parquet file, or those of its columns that are wanted.

    Raises PluginUnavailable without pyarrow, ConfigError, TooLarge, DataDamaged.
    """
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise PluginUnavailable(PARQUET_HINT) from error
    with readable(path):
        refuse_devices(path)
        table = _table(path, wanted)
        numbers: dict[str, Numbers] = {}
        shapes: dict[str, tuple[int, int]] = {}
        texts: dict[str, list[str]] = {}
        for name, column in zip(table.column_names, table.columns, strict=True):
            values = _numbers(column)
            if values is None:
                texts[name] = _texts(path, column)
                values = seconds_since_first(texts[name])
                if values is None:
                    continue
            if values.ndim == 3:
                shapes[name] = (values.shape[1], values.shape[2])
            numbers[name] = values.reshape(len(values), -1) if values.ndim > 2 else values
        return [ColumnTable(source=path.name, numbers=numbers, shapes=shapes, texts=texts)]


def _table(path: Path, wanted: Collection[str] | None) -> Any:
    """Return the columns, read in parts that are counted. Texts stay numbers of a dictionary."""
    import pyarrow.parquet
    from pyarrow import types

    size = parquet_size(path)
    Unpacked(path).expect(size.unpacked_bytes)
    with pyarrow.parquet.ParquetFile(path) as file:
        Unpacked(path).expect(_BYTES_OF_A_NUMBER * max(size.values, size.rows * len(file.schema_arrow)))
        is_text = (types.is_string, types.is_large_string, types.is_binary)
        texts = [field.name for field in file.schema_arrow if any(test(field.type) for test in is_text)]
        names = None if wanted is None else [name for name in file.schema_arrow.names if name in wanted]
    unpacked = Unpacked(path)
    parts = []
    with pyarrow.parquet.ParquetFile(path, read_dictionary=texts, pre_buffer=False) as file:
        for part in file.iter_batches(batch_size=_ROWS_AT_ONCE, columns=names, use_threads=False):
            unpacked.add(part.nbytes)
            parts.append(part)
        return pyarrow.Table.from_batches(parts, parts[0].schema if parts else file.schema_arrow)


def _numbers(column: Any) -> Numbers | None:
    """Return a column of numbers, or of equally many numbers in each row; None if it is another one."""
    from pyarrow import ArrowException, float64, types

    kind = column.type
    if types.is_null(kind):
        return np.full(len(column), np.nan)
    if types.is_dictionary(kind):
        return _numbers_of_texts(column)
    try:
        if types.is_boolean(kind):
            return np.array(column.cast("int8").cast(float64()).to_numpy(), dtype=np.float64)
        if types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind):
            return np.array(column.cast(float64(), safe=False).to_numpy(), dtype=np.float64)
        if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
            return _numbers_of_lists(column)
    except (ArrowException, NotImplementedError):
        pass
    return None


def _numbers_of_texts(column: Any) -> Numbers | None:
    whole = column.unify_dictionaries().combine_chunks()
    words = whole.dictionary.to_pylist()
    numbers = columns_of_numbers({"": [word.strip() for word in words if isinstance(word, str)]})[""]
    if isinstance(numbers, NotNumbers) or len(numbers) < len(words):
        return None
    known = np.concatenate(([np.nan], numbers))
    places: Numbers = known[whole.indices.cast("int64").fill_null(-1).to_numpy(zero_copy_only=False) + 1]
    return places


def _numbers_of_lists(column: Any) -> Numbers | None:
    """Return equally many numbers of each row; a missing row is NaN where the others have one number."""
    whole = column.combine_chunks()
    if whole.null_count:
        known = _numbers_of_lists(_chunked(whole.drop_null()))
        if known is None or known.ndim > 1:
            return None
        numbers = np.full(len(whole), np.nan)
        numbers[whole.is_valid().to_numpy(zero_copy_only=False)] = known
        return numbers
    inner = whole.flatten()
    width, left_over = divmod(len(inner), len(whole)) if len(whole) else (0, 0)
    lengths = whole.value_lengths() if hasattr(whole, "value_lengths") else None
    if left_over or not width:
        return None
    if lengths is not None and (lengths.to_numpy(zero_copy_only=False) != width).any():
        return None
    flat = _numbers(_chunked(inner))
    if flat is None:
        return None
    values = flat.reshape(len(whole), width, *flat.shape[1:])
    return values[:, 0] if width == 1 else values


def _chunked(array: Any) -> Any:
    import pyarrow

    return pyarrow.chunked_array([array])


def _texts(path: Path, column: Any) -> list[str]:
    from pyarrow import types

    if types.is_dictionary(column.type):
        whole = column.unify_dictionaries().combine_chunks()
        words = ["", *("" if word is None else str(word) for word in whole.dictionary.to_pylist())]
        return [words[i + 1] for i in whole.indices.cast("int64").fill_null(-1).to_pylist()]
    Unpacked(path).expect(_BYTES_OF_A_TEXT * len(column))
    return ["" if word is None else str(word) for word in column.to_pylist()]
