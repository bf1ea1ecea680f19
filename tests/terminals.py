"""A command in a real terminal (a pty) of a given width, and what it shows there."""

from __future__ import annotations

import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
from collections.abc import Mapping, Sequence
from fcntl import ioctl
from typing import NamedTuple

CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
COMMAND = [sys.executable, "-c", "from graspsense.cli.entry import main; main()"]


class Shown(NamedTuple):
    """The exit code of a command, and all that the terminal received."""

    code: int
    raw: str

    @property
    def text(self) -> str:
        """The text without colours; of a line that was redrawn, what stays."""
        lines = (line.rpartition("\r")[2] for line in self.raw.replace("\r\n", "\n").split("\n"))
        return "\n".join(CONTROL.sub("", line) for line in lines)

    @property
    def lines(self) -> list[str]:
        return self.text.split("\n")

    @property
    def coloured(self) -> bool:
        return re.search(r"\x1b\[[0-9;]*m", self.raw) is not None


def in_terminal(
    arguments: Sequence[str],
    width: int = 80,
    *,
    typed: str = "",
    program: Sequence[str] = COMMAND,
    **environment: str,
) -> Shown:
    """Run `graspsense ARGUMENTS` with its input, output and errors on a terminal of `width` columns.

    `typed` is typed at the first question, which ends in `?] `.
    """
    master, slave = pty.openpty()
    ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, width, 0, 0))
    process = subprocess.Popen(
        [*program, *arguments],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        env=_environment(environment),
        start_new_session=True,
    )
    os.close(slave)
    received = b""
    while select.select([master], [], [], 300)[0]:
        try:
            part = os.read(master, 65536)
        except OSError:  # Linux says EIO when the last process has closed the terminal.
            break
        if not part:
            break
        received += part
        if typed and received.endswith(b"?] "):
            os.write(master, typed.encode())
            typed = ""
    os.close(master)
    return Shown(process.wait(), received.decode())


def _environment(extra: Mapping[str, str]) -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "NO_COLOR", "TERM", "LANG", "LC_ALL")}
    return {**kept, "TERM": "xterm-256color", "LANG": "C.UTF-8", **extra}
