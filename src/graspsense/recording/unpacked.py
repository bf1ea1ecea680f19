"""The limit on what a file may unpack to, and unpacking that ends there.

A small file can unpack to many gigabytes. What it says of its size is compared with the limit before anything is
unpacked, and what really comes out is counted, because a file can say anything.
"""

from __future__ import annotations

import bz2
import zlib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import lz4.frame
import zstandard
from attrs import define, field

from graspsense.core.values.errors import TooLarge
from graspsense.core.values.limits import UNPACKED_MB

_MB: Final = 1_000_000
_PIECE: Final = 1 << 20
_GZIP: Final = zlib.MAX_WBITS | 16


def limit_words() -> str:
    """Return the limit, and how it is raised, in words."""
    return f"the limit is {UNPACKED_MB.most} MB. If you trust the file, raise it: {UNPACKED_MB.variable}=MEGABYTES"


@define
class Unpacked:
    """What has been unpacked of one file, in bytes. Raises TooLarge when that passes the limit."""

    source: str | Path
    allowance: int = 0
    """Bytes beside the limit, such as those of the file itself."""
    total: int = field(default=0, init=False)
    _limit: int = field(factory=lambda: UNPACKED_MB.most * _MB, init=False)

    def expect(self, size: int) -> None:
        """Raise TooLarge if so many bytes more would pass the limit."""
        if self.total + size > self._limit + self.allowance:
            unpacked = f"{(self.total + size) / _MB:,.0f} MB".replace(",", " ")
            raise TooLarge(f"{self.source} unpacks to {unpacked} or more; {limit_words()}")

    def add(self, size: int) -> None:
        """Count so many bytes. Raises TooLarge."""
        self.expect(size)
        self.total += size

    def unpack(self, compression: str, data: bytes) -> bytes:
        """Return what compressed data holds; `compression` is a key of `_PIECES`, or empty.

        Raises TooLarge, ValueError, and what the library raises on damaged data.
        """
        if compression == "":
            return data
        if compression not in _PIECES:
            raise ValueError(f"the compression {compression[:20]!r} is not supported")
        parts = []
        for part in _PIECES[compression](data):
            self.add(len(part))
            parts.append(part)
        return b"".join(parts)


def _pieces_of(decompressor: Any, data: bytes) -> Iterator[bytes]:
    """Yield what a decompressor of the kind of the module bz2 makes of the data."""
    while not decompressor.eof:
        part = decompressor.decompress(data, _PIECE)
        if not part and not data and decompressor.needs_input:
            raise ValueError("the compressed data ends early")
        data = b""
        yield part


def _pieces_of_zlib(data: bytes, window: int = zlib.MAX_WBITS, *, ended: bool = True) -> Iterator[bytes]:
    """Yield what the data holds; a file of gzip may hold several streams one after the other.

    A stream that is not `ended` may lack its end, as MATLAB leaves it out behind whole pieces of 64 KiB.
    """
    while data:
        stream = zlib.decompressobj(window)
        while not stream.eof:
            part = stream.decompress(data, _PIECE)
            data = stream.unconsumed_tail
            if not part and not data:
                if ended:
                    raise ValueError("the compressed data ends early")
                break
            yield part
        data = stream.unused_data if window == _GZIP else b""


def _pieces_of_zstd(data: bytes) -> Iterator[bytes]:
    size, done = zstandard.frame_content_size(data), 0
    with zstandard.ZstdDecompressor().stream_reader(data) as stream:
        while part := stream.read(_PIECE):
            done += len(part)
            yield part
    if size >= 0 and done != size:
        raise ValueError(f"the compressed data ends after {done} of {size} bytes")


_PIECES: Final[Mapping[str, Callable[[bytes], Iterator[bytes]]]] = {
    "zlib": _pieces_of_zlib,
    "zlib of MATLAB": lambda data: _pieces_of_zlib(data, ended=False),
    "gzip": lambda data: _pieces_of_zlib(data, _GZIP),
    "zstd": _pieces_of_zstd,
    "lz4": lambda data: _pieces_of(lz4.frame.LZ4FrameDecompressor(), data),
    "bz2": lambda data: _pieces_of(bz2.BZ2Decompressor(), data),
}
