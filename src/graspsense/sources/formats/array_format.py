"""Files of named arrays as tables: NPY, NPZ, MAT and HDF5.

Which arrays belong to a grasp is told by a pattern of their names (`arrays` of a manifest). What the axes of an array
of three dimensions mean is told by `axes`. Without it, the axes are grasps, times and columns, and the user is asked to
confirm that, unless another array that the manifest uses has a number for each place along the first or last axis.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.core.values.errors import ConfigError, DataDamaged, listed
from graspsense.core.values.limits import RECORDINGS
from graspsense.sources.formats.hdf5_file import hdf5_arrays
from graspsense.sources.formats.mat_file import mat_variables
from graspsense.sources.formats.numpy_files import npy_array, npz_arrays
from graspsense.sources.formats.patterns import file_template
from graspsense.sources.formats.table import ColumnTable, Numbers, TableRules

Arrays = Mapping[str, NDArray[Any]]

COLUMN: Final = "column"
"""The field of `arrays` that names the column which an array is."""
GRASP: Final = "grasp"
TIME: Final = "time"
AXES: Final = (GRASP, TIME, "row", COLUMN)
"""What an axis of an array of three dimensions can be."""
_ALONE: Final = ""
"""Name of an array without one."""
_UNITS: Final = ".units"
"""Ending of the name of a text that is the unit of an array, as the reader of HDF5 files gives it."""


def arrays_in(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays in a file by their names; the one of an NPY file has an empty name.

    Raises PluginUnavailable, ConfigError, TooLarge, DataDamaged.
    """
    return dict(_READERS[path.suffix.lower()](path))


def _npy(path: Path) -> Arrays:
    array = npy_array(path)
    if not array.size:
        raise DataDamaged(f"{path}: an array of the shape {array.shape} has no numbers")
    if array.dtype.names:
        return {name: array[name] for name in array.dtype.names}
    if array.dtype.kind not in "fiub":
        raise DataDamaged(f"{path} holds values of type {array.dtype}, which are not numbers")
    if array.ndim not in (1, 2, 3):
        raise DataDamaged(f"{path}: an array of {array.ndim} dimensions is not a table")
    return {_ALONE: array}


_READERS: Final[Mapping[str, Callable[[Path], Arrays]]] = {
    ".npy": _npy,
    ".npz": npz_arrays,
    ".mat": mat_variables,
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), hdf5_arrays),
}
ARRAY_SUFFIXES: Final = tuple(_READERS)
_NO_RULES: Final = TableRules()


def read_arrays(path: Path, rules: TableRules = _NO_RULES) -> list[ColumnTable]:
    """Return the tables in a file of arrays: each array is a column, or several.

    Raises PluginUnavailable, ConfigError, TooLarge, DataDamaged.
    """
    return [
        table.with_fields(fields)
        for fields, group in _groups(path, arrays_in(path), rules.arrays)
        for table in _grasps(path, group, rules)
    ]


def _groups(path: Path, arrays: Arrays, pattern: str) -> Iterator[tuple[dict[str, str], Arrays]]:
    """Yield the arrays of each grasp with its facts. Arrays that the pattern does not name belong to every grasp."""
    if not pattern:
        yield {}, arrays
        return
    template = file_template(pattern)
    groups: dict[tuple[tuple[str, str], ...], dict[str, NDArray[Any]]] = {}
    common = {}
    for name, array in arrays.items():
        fields = template.fields(name)
        if fields is None:
            common[name] = array
            continue
        column = fields.pop(COLUMN, _ALONE)
        groups.setdefault(tuple(fields.items()), {})[column] = array
    if not groups:
        raise ConfigError(
            f"{path}: no array matches arrays = {pattern!r}. There are: {listed(tuple(arrays))}"
        )
    if too_many := RECORDINGS.exceeded(len(groups)):
        raise DataDamaged(f"{path}: {too_many}")
    for facts, group in groups.items():
        # The arrays of the grasp come first: their shape says how many grasps and times there are.
        yield dict(facts), group | {name: array for name, array in common.items() if name not in group}


def _grasps(path: Path, arrays: Arrays, rules: TableRules) -> Iterator[ColumnTable]:
    """Yield a table for each grasp in these arrays. Raises ConfigError, DataDamaged."""
    solid = {name: array for name, array in arrays.items() if array.ndim == 3 and array.dtype.kind in "fiub"}
    axes, question = rules.axes, ""
    if solid and not axes and not _have_a_time(arrays, rules.samples):
        axes = (GRASP, TIME, COLUMN)
        name, shape = next((name, array.shape) for name, array in solid.items())
        question = (
            f"the array {name or path.name} of the shape {shape} is read as {shape[0]} grasps of {shape[1]} samples of "
            f'{shape[2]} columns. Confirm it with axes = "grasp, time, column", or say what its axes are: grasp, time, '
            "row, column"
        )
    if not solid or not axes:
        yield _of_arrays(path, arrays)
        return
    order = [axes.index(axis) for axis in AXES if axis in axes]
    turned = {name: np.transpose(array, order) for name, array in solid.items()}
    others = {name: array for name, array in arrays.items() if name not in solid}
    if GRASP not in axes:
        yield _of_arrays(path, {**others, **turned}, rows=next(iter(turned.values())).shape[0])
        return
    grasps, times = next(iter(turned.values())).shape[:2]
    if not grasps * times:
        raise DataDamaged(f"{path} has an array of {grasps} grasps of {times} samples")
    if too_many := RECORDINGS.exceeded(grasps):
        raise DataDamaged(f"{path}: {too_many}")
    for k in range(grasps):
        part = {name: array[k] for name, array in turned.items() if array.shape[0] == grasps}
        for name, array in others.items():
            of_grasp = array.ndim and array.shape[0] == grasps and array.size > 1
            part[name] = array[k] if of_grasp and (array.ndim > 1 or grasps != times) else array
        table = _of_arrays(path, part, rows=times)
        yield evolve(
            table,
            source=f"{path.name}, index {k}",
            fields={"part": str(k), **table.fields},
            warnings=(question,) if question else (),
        )


def _have_a_time(arrays: Arrays, used: Collection[str]) -> bool:
    """Return whether an array that is used has a number for each place along the first or the last axis of another."""
    ends = {length for array in arrays.values() if array.ndim == 3 for length in array.shape[::2]}
    flat = [
        array for name, array in arrays.items() if name in used and array.ndim in (1, 2) and array.size > 1
    ]
    return any(ends & set(array.shape) for array in flat)


def _of_arrays(path: Path, arrays: Arrays, rows: int = 0) -> ColumnTable:
    """Return the table of these arrays. The length that most of them share is the number of rows if none is given."""
    numeric = {
        name: array
        for name, array in arrays.items()
        if array.dtype.kind in "fiub" and 1 <= array.ndim <= 4 and array.size > 1
    }
    if set(arrays) == {_ALONE}:
        numeric = {_ALONE: arrays[_ALONE]}
    if not numeric:
        raise DataDamaged(
            f"{path} has no array of numbers with one to four dimensions. It has: {', '.join(arrays)}"
        )
    if not rows:
        rows = len(numeric[_ALONE]) if _ALONE in numeric else _common_length(numeric)
    columns: dict[str, Numbers] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    for name, array in numeric.items():
        if rows not in (array.shape[0], array.shape[-1]):
            continue
        values = np.asarray(array if array.shape[0] == rows else np.moveaxis(array, -1, 0), dtype=np.float64)
        if values.ndim > 2:
            # Cells in rows and columns, each with its components if there are four dimensions.
            cells = values.shape[1:] if values.ndim == 4 and values.shape[3] in (2, 3) else ()
            shapes[name] = cells or (values.shape[1], int(np.prod(values.shape[2:])))
        values = values.reshape(rows, -1)
        if name:
            columns[name] = values[:, 0] if values.shape[1] == 1 else values
        if not name or (len(numeric) == 1 and values.shape[1] > 1):
            columns |= {f"c{k + 1}": values[:, k] for k in range(values.shape[1])}
    scalars = {
        name: str(array.reshape(-1)[0])
        for name, array in arrays.items()
        if array.size == 1 and array.dtype.kind in "fiubU" and name
    }
    units = {name: scalars[f"{name}{_UNITS}"] for name in columns if f"{name}{_UNITS}" in scalars}
    return ColumnTable(source=path.name, numbers=columns, shapes=shapes, fields=scalars, units=units)


def _common_length(arrays: Arrays) -> int:
    # The rows of an array of three dimensions are along its first axis, or along its last one as MATLAB users write it.
    lengths = Counter(
        length for array in arrays.values() for length in {array.shape[0], array.shape[-1]} if length > 1
    )
    most: int = max(lengths, key=lambda length: (lengths[length], length))
    return most
