"""HDF5 files, and MAT files of version 7.3: their arrays by their paths, read by h5py in another process.

A damaged file can end the process that reads it, and a file can name others that are read in its place. So a child
process copies the arrays within the limit on what a file may unpack to, and follows nothing out of the file.
"""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from graspsense.core.values.errors import DataDamaged, PluginUnavailable, TooLarge
from graspsense.core.values.limits import UNPACKED_MB
from graspsense.recording.readable import refuse_devices
from graspsense.recording.unpacked import limit_words
from graspsense.sources.formats.numpy_files import npz_arrays

HDF5_HINT: Final = (
    'HDF5 needs h5py.\n  in a clone: pip install -e ".[hdf5]"     published: pip install "graspsense[hdf5]"'
)
LONGEST_S: Final = 300.0
"""Seconds after which the reading of a file is given up."""
_TOO_LARGE: Final = 3
_CHILD: Final = Path(__file__).with_name("hdf5_child.py")


def hdf5_arrays(path: Path, advice: str = "") -> dict[str, NDArray[Any]]:
    """Return the arrays in an HDF5 file by their paths: `grasp_1/force`; `advice` is what else can be done.

    Raises PluginUnavailable without h5py, ConfigError, TooLarge, DataDamaged.
    """
    if importlib.util.find_spec("h5py") is None:
        raise PluginUnavailable(f"{path}: {HDF5_HINT}{advice}")
    refuse_devices(path)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.with_suffix(".npz").name
        most_bytes = UNPACKED_MB.most * 1_000_000
        command = [sys.executable, "-P", str(_CHILD), str(path.absolute()), str(copy), str(most_bytes)]
        # Filters of the file that are not part of the library would be loaded from a folder of the system.
        environment = {**os.environ, "HDF5_PLUGIN_PRELOAD": "::"}
        try:
            done = subprocess.run(
                command, env=environment, capture_output=True, text=True, errors="replace", timeout=LONGEST_S
            )
        except subprocess.TimeoutExpired as error:
            raise DataDamaged(f"{path} cannot be read as an HDF5 file within {LONGEST_S:g} s") from error
        if done.returncode == _TOO_LARGE:
            raise TooLarge(f"{path} unpacks to more than is accepted; {limit_words()}")
        if done.returncode:
            why = done.stderr.strip().splitlines()[-1:] or [f"the library ended with {done.returncode}"]
            raise DataDamaged(f"{path} cannot be read as an HDF5 file: {why[0][:300]}{advice}")
        return npz_arrays(copy)
