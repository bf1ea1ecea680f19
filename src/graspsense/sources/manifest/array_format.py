"""NPY, NPZ and MAT files as tables."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspsense.core.errors import DataDamaged
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.manifest.table import ColumnTable, Numbers
from graspsense.sources.numpy_files import npy_array, npz_arrays

_MAT_HEADER_BYTES: Final = 128
_COMPRESSED: Final = 15
"""The type of a compressed element of a MAT file of version 7."""
_LARGEST_ITEM: Final = 8
"""Bytes of a number of the largest type."""
_NUMERIC_CLASSES: Final = frozenset(
    {
        "double",
        "single",
        "logical",
        "char",
        *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
    }
)
"""Classes of variables that are read. Others, such as cells and structures, are no columns."""


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
    from scipy.io import loadmat, whosmat

    with readable(path):
        refuse_devices(path)
        _expect_variables(path, Unpacked(path))
        try:
            named = whosmat(str(path), appendmat=False)
        except NotImplementedError as error:
            raise DataDamaged(
                f"{path} is a MAT file of version 7.3, which is HDF5. Save it in MATLAB with: save(NAME, '-v7')"
            ) from error
        unpacked = Unpacked(path)
        numeric = [(name, shape) for name, shape, kind in named if kind in _NUMERIC_CLASSES]
        for _, shape in numeric:
            unpacked.add(_LARGEST_ITEM * math.prod(shape))
        variables = loadmat(str(path), appendmat=False, variable_names=[name for name, _ in numeric])
        return [_of_arrays(path, {name: one for name, one in variables.items() if not name.startswith("__")})]


def _expect_variables(path: Path, unpacked: Unpacked) -> None:
    """Raise TooLarge if the compressed variables of a MAT file of version 5 to 7 unpack to more than the limit."""
    with path.open("rb") as file:
        header = file.read(_MAT_HEADER_BYTES)
        order = {b"IM": "<", b"MI": ">"}.get(header[-2:])
        if order is None:
            return  # version 4, which does not compress
        tag = struct.Struct(f"{order}II")
        while len(head := file.read(tag.size)) == tag.size:
            kind, size = tag.unpack(head)
            data = file.read(min(size, path.stat().st_size))
            if kind == _COMPRESSED:
                unpacked.count_zlib(data)


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
