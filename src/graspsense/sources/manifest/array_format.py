"""NPY, NPZ and MAT files as tables. Arrays of Python objects are never loaded, because that would run code in them."""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from graspsense.core.errors import ConfigError, DataDamaged, named
from graspsense.sources.manifest.table import ColumnTable, Numbers


def read_npy(path: Path) -> list[ColumnTable]:
    """Return the table in an NPY file: rows are times, columns are c1, c2 and so on.

    An array of three dimensions has one grasp for each index of the first. Raises ConfigError, DataDamaged.
    """
    array = _loaded(path)
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
    """Return the table in an NPZ file: each array is a column, or several. Raises ConfigError, DataDamaged."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (OSError, ValueError, zipfile.BadZipFile, EOFError) as error:
        raise _unreadable(path, error, "NPZ") from error
    return [_of_arrays(path, arrays)]


def read_mat(path: Path) -> list[ColumnTable]:
    """Return the table in a MAT file of version 4 to 7: each numeric variable is a column, or several.

    Raises ConfigError, DataDamaged.
    """
    from scipy.io import loadmat

    try:
        variables = loadmat(str(path), appendmat=False)
    except NotImplementedError as error:
        raise DataDamaged(
            f"{path} is a MAT file of version 7.3, which is HDF5. Save it in MATLAB with: save(NAME, '-v7')"
        ) from error
    except FileNotFoundError as error:
        raise ConfigError(f"{path} cannot be read: there is no such file") from error
    except Exception as error:  # scipy raises various exceptions on damaged files
        raise _unreadable(path, error, "MAT") from error
    return [_of_arrays(path, {name: one for name, one in variables.items() if not name.startswith("__")})]


def _loaded(path: Path) -> Any:
    try:
        return np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise _unreadable(path, error, "NPY") from error


def _unreadable(path: Path, error: Exception, kind: str) -> Exception:
    if isinstance(error, OSError) and error.strerror:
        return ConfigError(f"{path} cannot be read: {error.strerror}")
    if "pickle" in str(error).lower():
        return DataDamaged(
            f"{path} is not a {kind} file of numbers. Python objects in it are not loaded, because that can run any "
            "code: save plain arrays of numbers"
        )
    return DataDamaged(f"{path} cannot be read as a {kind} file: {named(error)}")


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
