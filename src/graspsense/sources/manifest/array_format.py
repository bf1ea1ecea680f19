"""NPY, NPZ and MAT files as tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from graspsense.core.values.errors import DataDamaged
from graspsense.sources.manifest.mat_file import mat_variables
from graspsense.sources.manifest.table import ColumnTable, Numbers
from graspsense.sources.numpy_files import npy_array, npz_arrays


def read_npy(path: Path) -> list[ColumnTable]:
    """Return the table in an NPY file: rows are times, columns are c1, c2 and so on.

    An array of three dimensions has one grasp for each index of the first. Raises ConfigError, TooLarge, DataDamaged.
    """
    array = npy_array(path)
    if not array.size:
        raise DataDamaged(f"{path}: an array of the shape {array.shape} has no numbers")
    if array.dtype.names:
        return [_of_arrays(path, {name: _float(path, array[name]) for name in array.dtype.names})]
    values = _float(path, array)
    if values.ndim == 3:
        return [
            ColumnTable(source=f"{path.name}, index {i}", numbers=_columns(one), fields={"part": str(i)})
            for i, one in enumerate(values)
        ]
    if values.ndim not in (1, 2):
        raise DataDamaged(f"{path}: an array of {values.ndim} dimensions is not a table")
    return [ColumnTable(source=path.name, numbers=_columns(values.reshape(len(values), -1)))]


def read_npz(path: Path) -> list[ColumnTable]:
    """Return the table in an NPZ file: each array is a column, or several.

    Raises ConfigError, TooLarge, DataDamaged.
    """
    return [_of_arrays(path, npz_arrays(path))]


def read_mat(path: Path) -> list[ColumnTable]:
    """Return the table in a MAT file of version 4 to 7: each numeric variable is a column, or several.

    Raises ConfigError, TooLarge, DataDamaged.
    """
    return [_of_arrays(path, mat_variables(path))]


def _of_arrays(path: Path, arrays: Mapping[str, Any]) -> ColumnTable:
    """Return the table of these arrays. The length that most of them share is the number of rows."""
    numeric = {
        name: array
        for name, array in arrays.items()
        if isinstance(array, np.ndarray)
        and array.dtype.kind in "fiub"
        and array.ndim in (1, 2, 3)
        and array.size > 1
    }
    if not numeric:
        raise DataDamaged(
            f"{path} has no array of numbers with one to three dimensions. It has: {', '.join(arrays)}"
        )
    # The rows of an array of three dimensions are along its first axis, or along its last one as MATLAB users write it.
    lengths = Counter(
        length for array in numeric.values() for length in {array.shape[0], array.shape[-1]} if length > 1
    )
    rows = max(lengths, key=lambda length: (lengths[length], length))
    columns, shapes = {}, {}
    for name, array in numeric.items():
        if rows in (array.shape[0], array.shape[-1]):
            values = np.asarray(
                array if array.shape[0] == rows else np.moveaxis(array, -1, 0), dtype=np.float64
            )
            if values.ndim == 3:
                shapes[name] = (values.shape[1], values.shape[2])
            values = values.reshape(rows, -1)
            columns[name] = values[:, 0] if values.shape[1] == 1 else values
    scalars = {
        name: str(array.reshape(-1)[0])
        for name, array in arrays.items()
        if isinstance(array, np.ndarray) and array.size == 1 and array.dtype.kind in "fiubU"
    }
    return ColumnTable(source=path.name, numbers=columns, shapes=shapes, fields=scalars)


def _columns(values: Numbers) -> dict[str, Numbers]:
    return {f"c{k + 1}": values[:, k] for k in range(values.shape[1])} if values.ndim == 2 else {"c1": values}


def _float(path: Path, array: Any) -> Numbers:
    if array.dtype.kind not in "fiub":
        raise DataDamaged(f"{path} holds values of type {array.dtype}, which are not numbers")
    return np.asarray(array, dtype=np.float64)
