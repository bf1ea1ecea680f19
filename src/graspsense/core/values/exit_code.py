"""The exit codes of the command line, as `docs/commands.md` lists them; 0 means that the command finished."""

from __future__ import annotations

from enum import IntEnum


class ExitCode(IntEnum):
    """Why a command ended as it did."""

    CHECK_FAILED = 1
    """A requested check failed, or a task of an experiment failed."""
    WRONG_USE = 2
    """Wrong usage or wrong settings; a file or a disk cannot be read or written."""
    NO_DEVICE = 3
    """The device was not found."""
    NOT_FINISHED = 4
    """The grasp was aborted, or the device was lost."""
    DAMAGED = 5
    """Damaged data."""
    BUG = 70
    """A bug of graspsense or of a plugin."""
    INTERRUPTED = 130
    """Interrupted by Ctrl-C, SIGTERM or SIGHUP."""
    BROKEN_PIPE = 141
    """The program that reads the output has closed the pipe."""
