"""MAT files: their variables that are full arrays of numbers or one line of text, also in structures and cells.

The reader of scipy ends the process on some damaged files, so this is one of our own. Nothing is allocated before its
size was compared with the bytes that are there and with the limit. The format is that of MathWorks, "MAT-File Format".
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.errors import ConfigError
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.formats.hdf5_file import hdf5_arrays

_HEADER_BYTES: Final = 128
_MATRIX: Final = 14
_COMPRESSED: Final = 15
_STORED: Final[Mapping[int, str]] = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""Type of an element to the numbers in it."""
_CHARACTERS: Final[Mapping[int, str]] = {
    1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32",
}  # fmt: skip
_CELL, _STRUCTURE, _CHAR = 1, 2, 4
_MOST: Final = 100_000
"""Most arrays of a file."""
_DEEPEST: Final = 8
"""Most parts of a path behind the name of a variable."""
_NUMERIC: Final[Mapping[int, str]] = {
    6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4", 14: "i8", 15: "u8",
}  # fmt: skip
"""Class of a variable to its numbers. Objects and sparse matrices have other classes, which are not read."""
_COMPLEX: Final = 0x0800
_STORED_BY_4: Final = ("f8", "f4", "i4", "i2", "u2", "u1")


def mat_variables(path: Path) -> dict[str, NDArray[Any]]:
    """Return the variables in a MAT file by their names. Raises ConfigError, TooLarge, DataDamaged."""
    unpacked = Unpacked(path)
    with readable(path, "a MAT file"):
        refuse_devices(path)
        data = path.read_bytes()
        if len(data) >= 4 and 0 in data[:4]:
            return dict(_of_version_4(data))
        order = {b"IM": "<", b"MI": ">"}.get(data[_HEADER_BYTES - 2 : _HEADER_BYTES])
        if order is None:
            raise ValueError("it has no header")
        (version,) = struct.unpack_from(f"{order}H", data, _HEADER_BYTES - 4)
        if version >> 8 == 2:  # version 7.3
            return hdf5_arrays(path, "\n  or save the file in MATLAB with: save(NAME, '-v7')")
        variables: dict[str, NDArray[Any]] = {}
        for kind, content in _elements(data[_HEADER_BYTES:], order):
            if kind == _COMPRESSED:
                ((kind, content),) = _elements(unpacked.unpack("zlib of MATLAB", content), order)
            for name, variable in _variables(content, order) if kind == _MATRIX else ():
                variables[name] = variable
                if len(variables) > _MOST:
                    raise ValueError(f"it has more than {_MOST} arrays")
    if not variables:
        raise ConfigError(
            f"{path} has no array of numbers. Tables and objects of MATLAB are saved as structures first"
        )
    return variables


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of the elements that follow each other. Raises ValueError if one ends behind the data."""
    position = 0
    while position + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, position)
        begin = position + 8
        if kind >> 16:  # a small element has its size and its data in the tag
            kind, size, begin = kind & 0xFFFF, kind >> 16, position + 4
        if begin + size > len(data):
            raise ValueError(f"an element of {size} bytes ends behind the file")
        yield kind, data[begin : begin + size]
        position = begin + size
        if kind != _COMPRESSED:
            position += -position % 8


def _variables(data: bytes, order: str, path: str = "") -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield path and value of a variable, or of those in it: `jar/force`, `trials/3/force`. Other classes have none."""
    if not data:  # an empty cell
        return
    (_, flags), (_, dimensions), (_, name), *values = _elements(data, order)
    (word,) = struct.unpack_from(f"{order}I", flags)
    path, kind = path or name.decode("latin-1"), word & 0xFF
    if not path:  # what MATLAB keeps of objects
        return
    if kind in (_CELL, _STRUCTURE):
        if path.count("/") > _DEEPEST:
            raise ValueError(f"{path[:40]}... is nested too deep")
        yield from _parts(values, order, path, kind)
    elif kind == _CHAR:
        text = _text(*values[0], order) if values else ""
        if text and np.frombuffer(dimensions, dtype=f"{order}i4")[0] == 1:
            yield path, np.array([text])
    elif kind in _NUMERIC and values and not word & _COMPLEX:
        shape = np.frombuffer(dimensions, dtype=f"{order}i4").tolist()
        numbers = np.frombuffer(values[0][1], dtype=f"{order}{_STORED[values[0][0]]}")
        if min(shape, default=0) < 0 or math.prod(shape) != len(numbers):
            raise ValueError(f"a variable of the shape {tuple(shape)} has {len(numbers)} numbers")
        yield path, numbers.astype(_NUMERIC[kind]).reshape(shape, order="F")


def _parts(
    values: list[tuple[int, bytes]], order: str, path: str, kind: int
) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the variables in a cell array, or in the fields of a structure; several structures have numbers."""
    fields = [""]
    if kind == _STRUCTURE:
        (_, length), (_, names), *values = values
        (size,) = struct.unpack_from(f"{order}i", length)
        fields = [
            names[k : k + size].partition(b"\0")[0].decode("latin-1") for k in range(0, len(names), size)
        ]
    numbered = kind == _CELL or len(values) > len(fields)
    for k, (_, content) in enumerate(values):
        number = f"/{k // len(fields) + 1}" if numbered else ""
        field = f"/{fields[k % len(fields)]}".rstrip("/")
        yield from _variables(content, order, f"{path}{number}{field}")


def _text(kind: int, data: bytes, order: str) -> str:
    encoding = _CHARACTERS[kind]
    if encoding in ("utf-16", "utf-32"):
        encoding += "-le" if order == "<" else "-be"
    return data.decode(encoding)


def _of_version_4(data: bytes) -> Iterator[tuple[str, NDArray[Any]]]:
    """Yield the variables of a file of version 4, each a matrix behind a header of five numbers."""
    position = 0
    while position < len(data):
        order = "<" if struct.unpack_from("<I", data, position)[0] < 5000 else ">"
        kind, rows, columns, imaginary, length = struct.unpack_from(f"{order}5I", data, position)
        number = np.dtype(f"{order}{_STORED_BY_4[kind // 10 % 10]}")
        begin = position + 20 + length
        size = rows * columns * number.itemsize
        if kind // 1000 > 1 or begin + size * (2 if imaginary else 1) > len(data):
            raise ValueError(f"a matrix of {rows} rows and {columns} columns ends behind the file")
        name = data[position + 20 : begin].rstrip(b"\0").decode("latin-1")
        values = np.frombuffer(data, dtype=number, count=rows * columns, offset=begin)
        if kind % 10 == 0 and not imaginary:
            yield name, values.astype(number.newbyteorder("=")).reshape((rows, columns), order="F")
        elif kind % 10 == 1 and rows == 1:
            yield name, np.array(["".join(map(chr, values.astype(np.int64) & 0xFF))])
        position = begin + size * (2 if imaginary else 1)
