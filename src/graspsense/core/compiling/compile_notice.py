"""Telling a user that code is being compiled, which is silent and takes up to a minute."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

WORTH_TELLING_S: Final = 4.0
"""Shortest expected time of compiling that is told."""
_BYTES_A_SECOND: Final = 1800.0
"""Byte code that is compiled in a second, on a machine of 2025 that has nothing else to do; it says how long about."""


def _tell_nobody(_text: str) -> None:
    pass


_said: Callable[[str], None] = _tell_nobody


def tell_compiling(said: Callable[[str], None]) -> None:
    """Have `said` called with a sentence whenever this process begins to compile for some seconds."""
    global _said
    _said = said


def compiling_begins(name: str, code_bytes: int) -> None:
    """Tell that a function is compiled, whose code with all that it calls has so many bytes."""
    seconds = code_bytes / _BYTES_A_SECOND
    if seconds >= WORTH_TELLING_S:
        _said(f"compiling {name.replace('_', ' ')}: about {seconds:.0f} s; later runs load the result")
