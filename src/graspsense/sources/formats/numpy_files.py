"""NPY and NPZ files, read within the limit on what a file may unpack to.

A file states the shape of each array, and an archive the size of each member. Both are compared with the bytes that are
there before anything is allocated. Arrays of Python objects are never loaded, because that would run code in them.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any, Final

from numpy.lib import format as npy
from numpy.typing import NDArray

from graspsense.core.values.errors import DataDamaged
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked

_COMPRESSIONS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Those that NumPy writes. Others allocate what the file asks for."""
_MEMBER: Final = ".npy"
_END_BYTES: Final = 66_000
"""The largest end of an archive."""


def npy_array(path: Path) -> NDArray[Any]:
    """Return the array in an NPY file. Raises ConfigError, TooLarge, DataDamaged."""
    with readable(path, "an NPY file"):
        refuse_devices(path)
        with path.open("rb") as file:
            return _array(file, path.stat().st_size, str(path), Unpacked(path))


def npz_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Return the arrays in an NPZ file by their names. Raises ConfigError, TooLarge, DataDamaged."""
    unpacked = Unpacked(path)
    with readable(path, "an NPZ file"):
        refuse_devices(path)
        with path.open("rb") as opened:
            opened.seek(max(0, path.stat().st_size - _END_BYTES))
            opened.read(_END_BYTES)  # an error of the disk there would be told as a damaged archive
            archive = zipfile.ZipFile(opened)
            members = [member for member in archive.infolist() if member.filename.endswith(_MEMBER)]
            unpacked.expect(sum(member.file_size for member in members))
            arrays = {}
            for member in members:
                if member.compress_type not in _COMPRESSIONS:
                    raise DataDamaged(
                        f"{path}: {member.filename} has a compression that NumPy does not write"
                    )
                name = member.filename.removesuffix(_MEMBER)
                with archive.open(member) as file:
                    arrays[name] = _array(file, member.file_size, f"{path}: {name}", unpacked)
            return arrays


def _array(file: IO[bytes], size: int, source: str, unpacked: Unpacked) -> NDArray[Any]:
    """Return the array in a file of so many bytes, or in a member of an archive."""
    version = npy.read_magic(file)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise DataDamaged(f"{source} has version {version} of the NPY format, which is not known")
    # Version 3 differs from 2 in the encoding of the names of fields only, and numbers have none.
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read_header(file)
    if dtype.hasobject:
        raise DataDamaged(
            f"{source} is not an array of numbers. Python objects in it are not loaded, because that can run any code: "
            "save plain arrays of numbers"
        )
    unpacked.expect(size)
    if dtype.itemsize == 0 or any(length < 0 for length in shape) or (0 in shape and max(shape) > size):
        raise DataDamaged(
            f"{source} has the shape {shape} of values of {dtype.itemsize} bytes, which cannot be"
        )
    expected, there = math.prod(shape) * dtype.itemsize, size - file.tell()
    if expected != there:
        raise DataDamaged(f"{source} has {there} bytes of numbers, but its shape {shape} has {expected}")
    unpacked.add(expected)
    file.seek(0)
    values: NDArray[Any] = npy.read_array(file, allow_pickle=False)
    return values
