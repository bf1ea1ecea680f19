"""Reading a file in another process, where a library of its format could end ours or fill the memory.

The program is a file of this folder that imports nothing of graspsense. It is called with the file, what else it is
told, and the largest number of bytes that it may give.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Final

from graspsense.core.values.errors import DataDamaged, TooLarge
from graspsense.core.values.limits import UNPACKED_MB
from graspsense.recording.readable import refuse_devices
from graspsense.recording.unpacked import limit_words

LONGEST_S: Final = 300.0
"""Seconds after which the reading of a file is given up."""
_TOO_LARGE: Final = 3
"""The exit code of a program that would give more bytes than it may."""
# Filters of an HDF5 file that are not part of the library would be loaded from a folder of the system.
_ENVIRONMENT: Final = {"HDF5_PLUGIN_PRELOAD": "::", "PYTHONIOENCODING": "utf-8", "RUST_BACKTRACE": "0"}


def read_by(program: str, path: Path, kind: str, *others: Path, advice: str = "") -> str:
    """Return what the program prints of a file; `kind` is what it should be, as in `an HDF5 file`.

    `advice` is what can be done if it is not. Raises ConfigError, TooLarge, DataDamaged.
    """
    refuse_devices(path)
    child = Path(__file__).with_name(program)
    most_bytes = UNPACKED_MB.most * 1_000_000
    command = [sys.executable, "-P", str(child), str(path.absolute()), *map(str, others), str(most_bytes)]
    try:
        done = subprocess.run(
            command,
            env={**os.environ, **_ENVIRONMENT},
            capture_output=True,
            encoding="utf-8",
            errors="replace",
            timeout=LONGEST_S,
        )
    except subprocess.TimeoutExpired as error:
        raise DataDamaged(f"{path} cannot be read as {kind} within {LONGEST_S:g} s") from error
    if done.returncode == _TOO_LARGE:
        raise TooLarge(f"{path} unpacks to more than is accepted; {limit_words()}")
    if done.returncode:
        said = done.stderr.strip().splitlines() or [f"the library ended with {done.returncode}"]
        # A library that aborts says why first; Python says it last.
        why = said[0] if done.returncode < 0 else said[-1]
        raise DataDamaged(f"{path} cannot be read as {kind}: {why[:300]}{advice}")
    return done.stdout
