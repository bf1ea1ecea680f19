"""How whoever calls gives an option: `--label COLUMN` to a command, `label=COLUMN` to a function."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from contextlib import contextmanager

_commands = False


@contextmanager
def command_line(*, taken: bool = True) -> Iterator[None]:
    """Have messages inside this context name options as commands take them, or as functions do if not `taken`."""
    global _commands
    outside, _commands = _commands, taken
    try:
        yield
    finally:
        _commands = outside


def option(name: str, value: str = "", *, python: str = "") -> str:
    """Return an option as the caller gives it; `python` is its name as an argument, where that is another one.

    >>> option("label", "COLUMN"), option("label", "tilt angle")
    ('label=COLUMN', "label='tilt angle'")
    """
    if _commands:
        return f"--{name.replace('_', '-')}{f' {shlex.quote(value)}' if value else ''}"
    return f"{python or name}{f'={shlex.quote(value)}' if value else ''}"


def set_option(*texts: str) -> str:
    """Return settings `TABLE.KEY=VALUE` as the caller gives them: each after -o, or in `options`.

    >>> set_option("run.seed=3")
    "options=['run.seed=3']"
    """
    return " ".join(f"-o {text}" for text in texts) if _commands else f"options={list(texts)}"
