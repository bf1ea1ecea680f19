"""HDF5 files, and MAT files of version 7.3: their arrays by their paths, read by h5py in another process.

A damaged file can end the process that reads it, and a file can name others that are read in its place. So a child
process copies the arrays within the limit on what a file may unpack to, and follows nothing out of the file.
"""

from __future__ import annotations

import importlib.util
import tempfile
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from graspsense.core.values.errors import PluginUnavailable
from graspsense.sources.formats.numpy_files import npz_arrays
from graspsense.sources.formats.reading_process import read_by

HDF5_HINT: Final = (
    'HDF5 needs h5py.\n  in a clone: pip install -e ".[hdf5]"     published: pip install "graspsense[hdf5]"'
)


def hdf5_arrays(path: Path, advice: str = "") -> dict[str, NDArray[Any]]:
    """Return the arrays in an HDF5 file by their paths: `grasp_1/force`; `advice` is what else can be done.

    Raises PluginUnavailable without h5py, ConfigError, TooLarge, DataDamaged.
    """
    if importlib.util.find_spec("h5py") is None:
        raise PluginUnavailable(f"{path}: {HDF5_HINT}{advice}")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.with_suffix(".npz").name
        read_by("hdf5_child.py", path, "an HDF5 file", copy, advice=advice)
        return npz_arrays(copy)
