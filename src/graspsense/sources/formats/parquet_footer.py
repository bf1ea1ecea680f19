"""What the footer of a Parquet file says of its size: rows, values and bytes.

pyarrow ends the process when it is asked for the columns of some damaged footers, so they are read here. The footer is
a structure in the compact protocol of Apache Thrift; the numbers of the fields are those of parquet.thrift.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, Final

from attrs import frozen

from graspsense.recording.unpacked import Unpacked

_MAGIC: Final = b"PAR1"
_END_BYTES: Final = 8
_DEEPEST: Final = 32
_OBJECT_BYTES: Final = 32
"""Bytes that a byte of the footer becomes in memory, at most about."""
_STOP, _TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _LIST, _SET, _STRUCT = 0, 1, 2, 3, 7, 8, 9, 10, 12
_ROWS, _ROW_GROUPS = 3, 4
_COLUMNS, _COLUMN = 1, 3
_VALUES, _UNPACKED_BYTES = 5, 6


@frozen(kw_only=True)
class ParquetSize:
    """Rows of a Parquet file, the values of all its columns, and the bytes that they unpack to."""

    rows: int
    values: int
    unpacked_bytes: int


def parquet_size(path: Path) -> ParquetSize:
    """Return what the footer says. Raises OSError, ValueError, and other errors for what is no footer; TooLarge."""
    with path.open("rb") as file:
        size = path.stat().st_size
        file.seek(max(0, size - _END_BYTES))
        end = file.read(_END_BYTES)
        if len(end) < _END_BYTES or end[4:] != _MAGIC:
            raise ValueError("it has no footer")
        (length,) = struct.unpack("<I", end[:4])
        if length > size - _END_BYTES:
            raise ValueError(f"its footer of {length} bytes is longer than the file")
        Unpacked(f"the footer of {path}").expect(_OBJECT_BYTES * length)
        file.seek(size - _END_BYTES - length)
        footer = _Compact(file.read(length)).value(_STRUCT, 0)
    columns = [column.get(_COLUMN, {}) for group in footer[_ROW_GROUPS] for column in group[_COLUMNS]]
    return ParquetSize(
        rows=footer[_ROWS],
        values=sum(max(column.get(_VALUES, 0), 0) for column in columns),
        unpacked_bytes=sum(max(column.get(_UNPACKED_BYTES, 0), 0) for column in columns),
    )


class _Compact:
    """A reader of the compact protocol: structures become dictionaries by the numbers of their fields."""

    def __init__(self, data: bytes) -> None:
        self.data, self.place = data, 0

    def value(self, kind: int, depth: int) -> Any:
        """Return the next value of this type. Raises IndexError or ValueError where there is none."""
        if depth > _DEEPEST:
            raise ValueError("its footer is too deep")
        if kind == _STRUCT:
            return self._struct(depth)
        if kind in (_LIST, _SET):
            head = self._byte()
            size = head >> 4 if head >> 4 < 15 else self._varint()
            if size > len(self.data):
                raise ValueError(f"a list of its footer has {size} items")
            return [self._item(head & 15, depth) for _ in range(size)]
        if kind == _BINARY:
            return self._skip(self._varint())
        if kind == _DOUBLE:
            return self._skip(8)
        if kind == _BYTE:
            return self._byte()
        if kind in (4, 5, 6):
            number = self._varint()
            return (number >> 1) ^ -(number & 1)
        raise ValueError(f"its footer has a value of the type {kind}")

    def _item(self, kind: int, depth: int) -> Any:
        return self._byte() if kind in (_TRUE, _FALSE) else self.value(kind, depth + 1)

    def _struct(self, depth: int) -> dict[int, Any]:
        fields: dict[int, Any] = {}
        number = 0
        while (head := self._byte()) != _STOP:
            kind = head & 15
            number = number + (head >> 4) if head >> 4 else self.value(4, depth)
            fields[number] = kind == _TRUE if kind in (_TRUE, _FALSE) else self.value(kind, depth + 1)
        return fields

    def _skip(self, size: int) -> None:
        if size > len(self.data) - self.place:
            raise ValueError("its footer ends early")
        self.place += size

    def _byte(self) -> int:
        byte = self.data[self.place]
        self.place += 1
        return byte

    def _varint(self) -> int:
        number = shift = 0
        while True:
            byte = self._byte()
            number |= (byte & 0x7F) << shift
            if byte < 0x80:
                return number
            shift += 7
            if shift > 63:
                raise ValueError("a number of its footer is too long")
