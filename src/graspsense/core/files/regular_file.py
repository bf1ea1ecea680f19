"""Reading a file that a user names: a regular one, of a bounded size.

A pipe without a writer, or a device such as /dev/zero, would keep its reader for ever or take all memory.
"""

from __future__ import annotations

import errno
import os
import stat
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import BinaryIO, Final, cast

_WITHOUT_WAITING: Final = (
    getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
)


class NotAFile(OSError):
    """A pipe, a socket or a device where a file is needed."""


def opened_file(source: Traversable | Path) -> BinaryIO:
    """Open a regular file for reading. Raises OSError if it cannot be, NotAFile if it is a pipe or a device."""
    if not isinstance(source, Path):
        return cast(BinaryIO, source.open("rb"))
    descriptor = os.open(source, os.O_RDONLY | _WITHOUT_WAITING)
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind):
        return os.fdopen(descriptor, "rb")
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(source))
    raise NotAFile(f"{source} is a pipe or a device, not a file")


def first_bytes(source: Traversable | Path, most: int) -> bytes:
    """Return the content of a regular file, of a larger one `most` + 1 bytes. Raises OSError, NotAFile."""
    with opened_file(source) as file:
        return file.read(most + 1)
