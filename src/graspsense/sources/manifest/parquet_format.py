"""Parquet files as tables, read by pyarrow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from graspsense.core.errors import ConfigError, DataDamaged, PluginUnavailable, named
from graspsense.recording.parquet import PARQUET_HINT
from graspsense.sources.manifest.table import ColumnTable, Numbers


def read_parquet(path: Path) -> list[ColumnTable]:
    """Return the table in a Parquet file. Raises PluginUnavailable without pyarrow, ConfigError, DataDamaged."""
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise PluginUnavailable(PARQUET_HINT) from error
    try:
        table = pyarrow.parquet.read_table(path)
    except FileNotFoundError as error:
        raise ConfigError(f"{path} cannot be read: there is no such file") from error
    except Exception as error:  # pyarrow has exceptions of its own for damaged files
        raise DataDamaged(f"{path} cannot be read as a Parquet file: {named(error)}") from error
    numbers: dict[str, Numbers] = {}
    texts: dict[str, list[str]] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        values: list[Any] = column.to_pylist()
        try:
            numbers[name] = np.array(
                [[float("nan")] if one is None else np.atleast_1d(one) for one in values], dtype=np.float64
            )
            if numbers[name].shape[1] == 1:
                numbers[name] = numbers[name][:, 0]
        except (TypeError, ValueError):
            texts[name] = ["" if one is None else str(one) for one in values]
    return [ColumnTable(source=path.name, numbers=numbers, texts=texts)]
