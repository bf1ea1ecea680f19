"""Every error a user can meet: what was found, what is allowed, what to do.

Each class carries the exit code the command line ends with. A grasp that goes wrong is no error: that is an
`Outcome` (see `graspsense.core.signals`).
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class GraspsenseError(Exception):
    """Base of all errors meant for the user; `exit_code` is what the command line returns."""

    exit_code = 70


class ConfigError(GraspsenseError):
    """A pipeline, experiment or option that cannot be used as written."""

    exit_code = 2


class UnknownName(ConfigError):
    """A name that nothing answers to, or that more than one distribution answers to."""


class WiringError(ConfigError):
    """Two components that do not fit together."""


class PluginUnavailable(ConfigError):
    """A component whose code cannot be imported here."""


class ComponentFailed(GraspsenseError):
    """A component of a plugin raised an exception that its contract does not allow."""


class NoDevice(GraspsenseError):
    """The gripper asked for is not there."""

    exit_code = 3


class DeviceLost(GraspsenseError):
    """The gripper was there and stopped answering."""

    exit_code = 4


class TareRefused(GraspsenseError):
    """The pads cannot be zeroed now: loaded, silent or unsteady."""

    exit_code = 4


class DataDamaged(GraspsenseError):
    """A file of ours or somebody else's that cannot be read as what it claims to be."""

    exit_code = 5


class RecordingEnded(Exception):
    """A replayed recording has no further frame. The runner turns it into an outcome; no user sees it."""


def named(error: BaseException) -> str:
    """Return an exception of anybody's in words: `ZeroDivisionError: float division by zero`."""
    return f"{type(error).__name__}: {error}"


def suggestion(found: str, allowed: Iterable[str]) -> str:
    """Return `" Did you mean 'x'?"` for the nearest allowed name, or an empty string."""
    near = get_close_matches(found, sorted(allowed), n=1, cutoff=0.5)
    return f" Did you mean {near[0]!r}?" if near else ""
