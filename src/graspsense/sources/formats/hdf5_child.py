"""Copy the arrays of an HDF5 file into an NPZ file: `python hdf5_child.py FILE OUT.npz MOST_BYTES`.

A damaged file can end the process in the HDF5 library, so this is a program of its own. It imports nothing of
graspsense. What a file names outside of itself is not followed: external links, external storage, virtual datasets.
"""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Iterator
from typing import Any

import h5py
import numpy as np

MOST_OBJECTS = 100_000
DEEPEST = 32
UNITS = ".units"
"""Ending of the name of a text with the unit of an array, which is its attribute `units`."""


def datasets(group: Any, name: str, seen: set[Any], depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the datasets of a group with their paths, each group once."""
    for key in group:
        if len(seen) > MOST_OBJECTS or depth > DEEPEST:
            raise ValueError(
                f"it has more than {MOST_OBJECTS} objects, or groups nested deeper than {DEEPEST}"
            )
        if not isinstance(group.get(key, getlink=True), h5py.HardLink) or key in ("#refs#", "#subsystem#"):
            continue
        member = group[key]
        address = h5py.h5o.get_info(member.id).addr
        path = f"{name}/{key}" if name else key
        if isinstance(member, h5py.Group) and address not in seen:
            seen.add(address)
            yield from datasets(member, path, seen, depth + 1)
        elif isinstance(member, h5py.Dataset):
            seen.add(path)
            yield path, member


def arrays(path: str, name: str, dataset: Any, left: int) -> Iterator[tuple[str, Any]]:
    """Yield the arrays of numbers or texts in a dataset. Raises OverflowError if it has more bytes than are left."""
    if dataset.shape is None or dataset.is_virtual or dataset.external or dataset.ndim > 3:
        return
    kind = dataset.dtype.kind
    text = h5py.check_string_dtype(dataset.dtype) is not None
    if kind not in "fiubV" and not text:
        return
    if dataset.size * dataset.dtype.itemsize > left:
        raise OverflowError
    values = dataset[()]
    if text:
        yield name, np.array(dataset.asstr()[()], dtype=np.str_)
    elif dataset.dtype.names:
        yield from (
            (f"{name}.{column}", values[column])
            for column in dataset.dtype.names
            if values[column].dtype.kind in "fiub"
        )
    elif kind != "V":
        matlab = dataset.attrs.get("MATLAB_class", b"")
        if matlab == b"char":
            yield name, np.array("".join(map(chr, np.ravel(values, order="F").tolist())))
        else:
            yield name, np.asarray(values).T if matlab else unpacked(np.asarray(values), dataset.attrs)
            unit = dataset.attrs.get("units", dataset.attrs.get("unit", ""))
            unit = unit.decode(errors="replace") if isinstance(unit, bytes) else unit
            if isinstance(unit, str) and unit:
                yield f"{name}{UNITS}", np.array(unit)


def unpacked(values: Any, attributes: Any) -> Any:
    """Return the numbers that the stored ones stand for, by the attributes of netCDF; NaN where one is missing.

    A number is `add_offset` + `scale_factor` * the stored one, unless that is `_FillValue` or a `missing_value`, or
    outside of `valid_range`, or of `valid_min` and `valid_max`. Whole numbers are without a sign if `_Unsigned` is
    "true". The attributes are of the type that is stored.
    """
    stored = values.dtype
    sign = attributes.get("_Unsigned", b"")
    if stored.kind == "i" and (sign.decode() if isinstance(sign, bytes) else str(sign)).lower() == "true":
        values = values.view(f"u{stored.itemsize}")

    def given(key: str) -> Any:
        known = np.ravel(attributes[key])
        # A bound or a filling of an unsigned number is written with the sign of the stored type.
        return (
            known.astype(stored).view(values.dtype) if known.dtype.kind == "i" != values.dtype.kind else known
        )

    absent = np.zeros(values.shape, dtype=np.bool_)
    for key in ("_FillValue", "missing_value"):
        if key in attributes:
            absent |= np.isin(values, given(key))
    for key, outside in (("valid_min", np.less), ("valid_max", np.greater)):
        if key in attributes:
            absent |= outside(values, given(key)[0])
    if "valid_range" in attributes:
        low, high = given("valid_range")[:2]
        absent |= (values < low) | (values > high)
    scale, offset = attributes.get("scale_factor"), attributes.get("add_offset")
    if scale is not None or offset is not None:
        values = values * np.float64(1.0 if scale is None else np.ravel(scale)[0])
        values = values + np.float64(0.0 if offset is None else np.ravel(offset)[0])
    return np.where(absent, np.nan, values) if absent.any() else values


def main(path: str, out: str, most: int) -> None:
    """Copy the arrays. Exits with a message if the file is not HDF5, or too large."""
    left = most
    with h5py.File(path, "r") as file, zipfile.ZipFile(out, "w") as archive:
        for name, dataset in datasets(file, "", {h5py.h5o.get_info(file.id).addr}, 0):
            for member, values in arrays(path, name, dataset, left):
                left -= values.nbytes
                if left < 0:
                    raise OverflowError
                with archive.open(f"{member}.npy", "w", force_zip64=True) as copy:
                    np.lib.format.write_array(copy, np.asanyarray(values, order="C"), allow_pickle=False)


if __name__ == "__main__":
    try:
        main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
    except OverflowError:
        sys.exit(3)
    except (OSError, ValueError, RuntimeError, KeyError, TypeError, MemoryError) as error:
        sys.exit(f"{type(error).__name__}: {error}")
