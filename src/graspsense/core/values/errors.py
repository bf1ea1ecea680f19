"""The errors that a user can meet. Their messages say what was found, what is allowed, and what to do.

Each class has the exit code of the command line. A grasp that fails is not an error but an `Outcome` (see
`graspsense.core.values.signals`).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from enum import IntEnum
from itertools import islice
from pathlib import Path
from typing import Final, NoReturn


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


MOST_NAMED: Final = 24
"""Limit on the names that an error lists."""
_LONGEST_NAME: Final = 100
_MOST_COMPARED: Final = 1000
_FRAMEWORK: Final = Path(__file__).parents[2]
_STANDARD_LIBRARY: Final = Path(os.__file__).parent


class GraspsenseError(Exception):
    """Base class of all errors for the user; `exit_code` is that of the command line."""

    exit_code: int = ExitCode.BUG


class ConfigError(GraspsenseError):
    """A pipeline, experiment or option that cannot be used as written."""

    exit_code = ExitCode.WRONG_USE


class UnknownName(ConfigError):
    """A name that is unknown, or that several distributions provide."""


class WiringError(ConfigError):
    """Two components that do not fit together."""


class PluginUnavailable(ConfigError):
    """A component whose code cannot be imported here."""


class ComponentFailed(GraspsenseError):
    """A component of a plugin raised an exception that its contract does not allow."""


class NoDevice(GraspsenseError):
    """The gripper is not connected."""

    exit_code = ExitCode.NO_DEVICE


class DeviceLost(GraspsenseError):
    """The gripper was open and no longer responds."""

    exit_code = ExitCode.NOT_FINISHED


class TareRefused(GraspsenseError):
    """The pads cannot be zeroed now: loaded, silent or unsteady."""

    exit_code = ExitCode.NOT_FINISHED


class DataDamaged(GraspsenseError):
    """A file whose content is not what its format requires."""

    exit_code = ExitCode.DAMAGED


FAILURES: Final = (Exception, SystemExit)
"""What the code of a plugin can raise, apart from KeyboardInterrupt, which is the user's.

SystemExit is a failure of the plugin too: it must not end the program, nor lose what was measured.
"""


@contextmanager
def exits_raise() -> Iterator[None]:
    """Within this context `os._exit`, which would end the program in silence, raises SystemExit as `sys.exit` does."""
    leave, process = os._exit, os.getpid()

    def raising(status: int) -> NoReturn:
        if os.getpid() != process:  # a process that was forked off ends so
            leave(status)
        raise SystemExit(f"os._exit({status})")

    os._exit = raising
    try:
        yield
    finally:
        os._exit = leave


class TooLarge(DataDamaged):
    """A file that unpacks to more than is allowed; `graspsense.recording.unpacked` has the limit."""


class RecordingEnded(Exception):
    """A replayed recording has no further frame. The runner turns this into an outcome."""


def named(error: BaseException) -> str:
    """Return an exception in words: `ZeroDivisionError: float division by zero`."""
    return f"{type(error).__name__}: {error}"


def place_of(error: BaseException) -> str:
    """Return the innermost place of a caught exception in the plugin that was called: ` in lab_hand/backend.py:12`.

    It is empty if no code of a plugin is in the traceback.
    """
    trace, folder, place = error.__traceback__, None, ""
    while trace is not None:
        path = Path(trace.tb_frame.f_code.co_filename)
        if path.is_file() and _is_of_a_plugin(path) and (folder is None or path.is_relative_to(folder)):
            folder, place = path.parent, f" in {path.parent.name}/{path.name}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place


def _is_of_a_plugin(path: Path) -> bool:
    if path.is_relative_to(_FRAMEWORK):
        return path.is_relative_to(_FRAMEWORK / "plugins")
    if path.parent.name == "pluggy":  # which calls the hooks of plugins
        return False
    return not path.is_relative_to(_STANDARD_LIBRARY) or "site-packages" in path.parts


def suggestion(word: str, allowed: Iterable[str]) -> str:
    """Return `" Did you mean 'x'?"` for the nearest allowed name, in any case, or an empty string."""
    if len(word) > _LONGEST_NAME:
        return ""
    comparable = sorted(islice((name for name in allowed if len(name) <= _LONGEST_NAME), _MOST_COMPARED))
    folded = {name.casefold(): name for name in comparable}
    near = get_close_matches(word.casefold(), folded, n=1, cutoff=0.6)
    return f" Did you mean {folded[near[0]]!r}?" if near else ""


def counted(count: int, single: str, several: str = "") -> str:
    """Return a count with its noun; `several` is the noun for any number but 1, by default with an s.

    >>> counted(1, "trial is", "trials are"), counted(3, "trial")
    ('1 trial is', '3 trials')
    """
    return f"{count} {single if count == 1 else several or f'{single}s'}"


def listed(names: Sequence[str]) -> str:
    """Return names with commas between them, at most `MOST_NAMED` of them, and how many more there are.

    >>> listed(["t", "gap"])
    't, gap'
    """
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more
