"""Files as a whole: written completely or not at all, and read if they are regular ones of a bounded size.

Data is written to a new file `NAME.<16 hexadecimal digits>.part` in the same folder, which takes the name when it is
complete and on the disk, whatever other programs write there. Its writer holds a lock on it: one without a lock was
left by a program that was killed, and is deleted when the next file is written to that folder. A pipe without a writer,
or a device such as /dev/zero, would keep its reader for ever or take all memory.
"""

from __future__ import annotations

import errno
import os
import re
import secrets
import stat
from contextlib import suppress
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import BinaryIO, Final, cast

from graspsense.core.values.errors import ConfigError, ExitCode, GraspsenseError

_LEFTOVER: Final = re.compile(r".+\.[0-9a-f]{16}\.part")
_SWEPT: Final[set[str]] = set()
"""Folders in which this process has deleted what killed programs left: once is enough."""


def write_whole(path: Path, data: bytes, *, replace: bool = True, mode: int = 0o666) -> None:
    """Write a file; when this returns, the data and the name are on the disk.

    `mode` is that of a new file, less the user's mask. Raises FileExistsError if `replace` is false and the file
    exists, and OSError, also if `path` is something else than a file, such as a device.
    """
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(path.stat().st_mode):
            raise OSError(errno.EINVAL, "it is not a regular file", str(path))
    _delete_leftovers(path.parent)
    part, fd = _new_part(path, mode)
    try:
        with os.fdopen(fd, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            # Named before it is closed, which ends the lock.
            if replace:
                os.replace(part, path)
            else:
                _link(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Wait until the disk has the folder's entries, so that a new name survives a loss of power. Raises OSError."""
    fd = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def _new_part(path: Path, mode: int) -> tuple[Path, int]:
    """Return a new, locked file in the folder of `path`, which no other program writes to."""
    while True:
        part = path.with_name(f"{path.name}.{secrets.token_hex(8)}.part")
        # Exclusive: a link or a pipe of this name, planted by somebody, is an error and is not followed.
        fd = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW, mode)
        locked(fd, waits=True)
        if os.fstat(fd).st_nlink:
            return part, fd
        os.close(fd)  # another program took it for a leftover before it was locked


def _link(part: Path, path: Path) -> None:
    """Give the file its name if the name is free. Raises FileExistsError."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise
    except OSError:
        # Some disks have no hard links.
        if path.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path)) from None
        os.replace(part, path)
        return
    part.unlink()


def _delete_leftovers(folder: Path) -> None:
    """Delete the unfinished files of killed programs in a folder, once in this process."""
    key = os.path.abspath(folder)
    if key in _SWEPT:
        return
    _SWEPT.add(key)
    with suppress(OSError):
        for entry in os.scandir(folder):
            if _LEFTOVER.fullmatch(entry.name):
                _delete_leftover(Path(entry.path))


def _delete_leftover(path: Path) -> None:
    with suppress(OSError):
        fd = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if stat.S_ISREG(os.fstat(fd).st_mode) and locked(fd):
                path.unlink()
        finally:
            os.close(fd)


def locked(fd: int, *, waits: bool = False) -> bool | None:
    """Lock a file until it is closed, and return True, or False if another program has locked it.

    With `waits`, wait for the other program. None means that the disk has no locks, as some network disks: whether
    another program uses the file is not known.
    """
    # Imported here: a system without it has no locks, and can still read.
    import fcntl

    try:
        fcntl.flock(fd, fcntl.LOCK_EX if waits else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


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


class SaveFailed(GraspsenseError):
    """Data could not be written to the disk."""

    exit_code = ExitCode.WRONG_USE


def write_new(path: Path, data: bytes) -> None:
    """Write a new file. Raises ConfigError if it already exists, SaveFailed if it cannot be written."""
    try:
        write_whole(path, data, replace=False)
    except FileExistsError:
        raise ConfigError(f"{path} already exists: name another file, or move it away") from None
    except OSError as error:
        raise SaveFailed(f"{path} cannot be written: {error.strerror}") from error


def write_or_replace(path: Path, data: bytes, *, make_folder: bool = False) -> None:
    """Write a file, or replace an existing one; when this returns, the data is on the disk.

    `make_folder` creates the folder of the file if it does not exist. Raises SaveFailed.
    """
    try:
        if make_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
    except OSError as error:
        raise SaveFailed(f"{path} cannot be written: {error.strerror}") from error
