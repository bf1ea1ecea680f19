"""The command line as a user types it, in this process, and Python in one of its own: how it ends, what it prints."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from typing import Any, NamedTuple

import pytest

from graspsense.cli.main import main
from graspsense.core.values.errors import ExitCode


class Done(NamedTuple):
    """How a command ended; the names are those of `subprocess.CompletedProcess`."""

    returncode: int
    stdout: str
    stderr: str

    @property
    def json(self) -> Any:
        return json.loads(self.stdout)


def graspsense(*arguments: object, answers: str = "", encoding: str = "utf-8") -> Done:
    """Run `graspsense ARGUMENTS`, with `answers` as its standard input, and return how it ended."""
    # With bytes below the text, as standard output has them.
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding, newline="", write_through=True) for _ in range(2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", io.StringIO(answers))
        with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
    code = ended.value.code or 0
    return Done(code, *(stream.buffer.getvalue().decode(encoding) for stream in (out, err)))


def printed(*arguments: object, **more: str) -> str:
    """Return what a command that ends well prints."""
    done = graspsense(*arguments, **more)
    assert done.returncode == 0, done.stderr
    return done.stdout


def answered(*arguments: object) -> Any:
    """Return what a command that ends well says as JSON."""
    return json.loads(printed(*arguments, "--json"))


def refused(*arguments: object, **more: str) -> str:
    """Return what a command that is used wrongly prints on standard error."""
    done = graspsense(*arguments, **more)
    assert done.returncode == ExitCode.WRONG_USE, done
    assert "Traceback" not in done.stderr
    return done.stderr


def python(*arguments: object, check: bool = False, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run Python with these arguments in a process of its own; return how it ended and what it printed."""
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=3600, check=check, **options)
