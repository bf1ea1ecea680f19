"""The records of an MCAP file in their order, and those in its chunks, unpacked within the limit.

Files are not trusted: no length in them is read beyond the end of the file, or unpacked beyond the limit.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import BinaryIO, Final

from attrs import define
from mcap.opcode import Opcode
from mcap.records import Chunk, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk

from graspsense.recording.unpacked import Unpacked

MAGIC: Final = b"\x89MCAP0\r\n"
"""How every MCAP file begins."""
_SMALL: Final = 1 << 16
"""Bytes that can be allocated for nothing."""
_RECORD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQII")
"""Begin, end, unpacked size and checksum of a chunk, and the length of the name of its compression."""


@define
class _WithinFile:
    """A file that allocates nothing for what is behind its end."""

    file: BinaryIO
    size: int

    def read(self, length: int) -> bytes:
        if length > _SMALL:
            length = min(length, max(0, self.size - self.file.tell()))
        return self.file.read(length)


def records_of(
    file: BinaryIO, unpacked: Unpacked, *, largest: int | None = None, validate_crcs: bool = False
) -> Iterator[McapRecord]:
    """Yield the records of a file, with each chunk as one of them.

    `largest` is the limit on the bytes of a record. Raises TooLarge, before the first record, if the chunks say that
    they unpack to more than the limit, and what the library raises on a damaged file.
    """
    size = os.fstat(file.fileno()).st_size
    # Also of a file that claims to be empty: a disk that fails is not a damaged file.
    file.read(len(MAGIC))
    unpacked.expect(_bytes_in_chunks(file, size))
    file.seek(0)
    limit = size if largest is None else min(size, largest)
    yield from StreamReader(
        _WithinFile(file, size),  # type: ignore[arg-type]
        emit_chunks=True,
        validate_crcs=validate_crcs,
        record_size_limit=limit,
    ).records


def records_in(chunk: Chunk, unpacked: Unpacked) -> Sequence[McapRecord]:
    """Return the records in a chunk. Raises TooLarge, and what the library raises on a damaged chunk."""
    if chunk.compression:
        unpacked.expect(chunk.uncompressed_size)
    data = unpacked.unpack(chunk.compression, chunk.data)
    if len(data) != chunk.uncompressed_size:
        raise ValueError(f"it unpacks to {len(data)} bytes, and says {chunk.uncompressed_size}")
    return breakup_chunk(replace(chunk, compression="", data=data), validate_crc=True)


def _bytes_in_chunks(file: BinaryIO, size: int) -> int:
    """Return how many bytes the compressed chunks of a file say that they unpack to."""
    position, total = len(MAGIC), 0
    while position + _RECORD.size <= size:
        file.seek(position)
        opcode, length = _RECORD.unpack(file.read(_RECORD.size))
        head = file.read(_CHUNK.size) if opcode == Opcode.CHUNK else b""
        if len(head) == _CHUNK.size:
            _, _, unpacked_size, _, name_length = _CHUNK.unpack(head)
            total += unpacked_size if name_length else 0
        position += _RECORD.size + length
    return total
