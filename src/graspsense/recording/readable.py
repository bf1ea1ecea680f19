"""What stops the reading of one recording is an error of this recording, so that the others of its set are read.

A damaged file makes the library of its format raise anything: errors of zlib or of a tokenizer, an overflow, a missing
key. This is the one place where such an exception gets its meaning.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final, TypeVar

from graspsense.core.components.registry.plugins import STRICT_VARIABLE
from graspsense.core.values.errors import ConfigError, DataDamaged, GraspsenseError, TooLarge, counted, named
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.unpacked import limit_words

T = TypeVar("T")
_OF_A_PROGRAM: Final = (NameError, AttributeError, AssertionError, ImportError, NotImplementedError)
"""What is more often a mistake in a reader than in a file."""
_OF_THE_DISK: Final = frozenset(
    {errno.EIO, errno.ENXIO, errno.ENODEV, errno.ESTALE, errno.ETIMEDOUT, errno.EREMOTEIO}
)
_OF_THE_CONTENT: Final = frozenset({None, errno.EINVAL, errno.EOVERFLOW, errno.EFBIG})
"""A damaged file makes its reader seek to places that there are not."""


@contextmanager
def readable(source: str | Path, kind: str = "", advice: str = "") -> Iterator[None]:
    """Turn whatever the reading of this recording raises into an error of ours that names it.

    `kind` is what it should be, as in `a ROS bag`, and `advice` what to do if it is not. Raises ConfigError if the file
    cannot be opened or its disk fails, TooLarge if the memory does not suffice, and DataDamaged for everything else.
    Errors of ours, Ctrl-C, and what `is_mistake` pass through.
    """
    damage = f"{source} cannot be read{f' as {kind}' if kind else ''}"
    try:
        yield
    except GraspsenseError:
        raise
    except MemoryError as error:
        raise TooLarge(f"{source} needs more memory than there is; {limit_words()}") from error
    except OSError as error:
        if error.errno in _OF_THE_CONTENT:
            raise DataDamaged(f"{damage}: {named(error)}{advice}") from error
        raise not_opened(source, error) from error
    except Exception as error:
        if is_mistake(error):
            raise
        raise DataDamaged(f"{damage}: {named(error)}{advice}") from error


def is_mistake(error: Exception) -> bool:
    """Return whether an error is that of a reader in development: a mistake in a program, where plugins are strict."""
    return isinstance(error, _OF_A_PROGRAM) and os.environ.get(STRICT_VARIABLE) == "1"


def not_opened(source: str | Path, error: OSError) -> ConfigError:
    """Return the error for a file that the operating system does not let us read."""
    if error.errno == errno.ENOENT:
        return ConfigError(f"{source} cannot be read: there is no file of this name")
    if error.errno in _OF_THE_DISK:
        return ConfigError(
            f"{source} cannot be read: the disk or its connection reports an error ({error.strerror}). The file itself "
            "may be whole: check the disk, and try again or read a copy"
        )
    return ConfigError(f"{source} cannot be read: {error.strerror or error}")


def refuse_devices(path: Path) -> None:
    """Raise ConfigError for a pipe or a device, whose reading might never end."""
    # Those of pathlib raise for a name that is too long.
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):
        raise ConfigError(f"{path} is a pipe or a device, not a file")


def each_readable(source: str, read: Callable[[], Iterable[T]]) -> Iterator[T | UnreadableRecording]:
    """Yield what `read` gives, and if it fails, as the last, why."""
    try:
        with readable(source):
            yield from read()
    except GraspsenseError as error:
        yield UnreadableRecording(source=source, error=error)


def error_of_all(unreadable: Sequence[UnreadableRecording]) -> GraspsenseError:
    """Return the error for a set of which no recording can be read: the first, and how many there are."""
    error = unreadable[0].error
    if len(unreadable) == 1:
        return error
    return type(error)(f"none of {len(unreadable)} recordings can be read. The first: {unreadable[0].line}")


def note_on(unreadable: Sequence[UnreadableRecording], total: int) -> list[str]:
    """Return a sentence on the recordings that cannot be read, among so many; nothing if all can be."""
    if not unreadable:
        return []
    count = len(unreadable)
    return [
        f"{count} of {counted(total, 'recording')} cannot be read and are left out. The first: {unreadable[0].line}"
    ]
