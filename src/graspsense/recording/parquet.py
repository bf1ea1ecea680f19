"""Encoding columns with units as a Parquet file, using pyarrow."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from graspsense.core.values.errors import PluginUnavailable

PARQUET_HINT: Final = (
    'Parquet needs pyarrow.\n  in a clone: pip install -e ".[parquet]"     published: '
    'pip install "graspsense[parquet]"'
)


def parquet(columns: Mapping[str, tuple[Any, str]]) -> bytes:
    """Return a Parquet file with these columns, given with their units. Raises PluginUnavailable without pyarrow."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise PluginUnavailable(PARQUET_HINT) from error
    arrays = {name: pyarrow.array(values) for name, (values, _) in columns.items()}
    fields = [
        pyarrow.field(name, array.type, metadata={"unit": columns[name][1]} if columns[name][1] else None)
        for name, array in arrays.items()
    ]
    table = pyarrow.Table.from_arrays(list(arrays.values()), schema=pyarrow.schema(fields))
    out = pyarrow.BufferOutputStream()
    pyarrow.parquet.write_table(table, out)
    return bytes(out.getvalue())
