"""A fitted estimator of scikit-learn as text, by skops: without pickle, and with listed types only.

skops is the extra `skops`. What its own list of safe types lacks is `TRUSTED`; a file that holds any other type is
refused before anything of it is made.
"""

from __future__ import annotations

import base64
import binascii
import math
from io import BytesIO
from typing import Any, Final
from zipfile import ZIP_STORED, BadZipFile, ZipFile

import numpy as np

from graspsense.plugin_api import PluginUnavailable
from graspsense.plugins.classifiers.fitted_estimators import refuse_misfit

TRUSTED: Final = ("sklearn.tree._tree.Tree",)
"""Types that the estimators need beyond those that skops regards as safe: the arrays of a decision tree."""
HINT: Final = (
    'a model kept as skops needs skops.\n  in a clone: pip install -e ".[skops]"     published: '
    'pip install "graspsense[skops]"'
)


def as_text(estimator: Any) -> str:
    """Return a fitted estimator as text. Raises PluginUnavailable without skops."""
    return base64.b64encode(_skops().dumps(estimator)).decode("ascii")


def from_text(text: str, expected: Any, features: int) -> Any:
    """Return the fitted estimator, of the class and with the settings of `expected`, for this number of features.

    Raises PluginUnavailable without skops, ValueError for any other object, for a type that is not listed, and for
    arrays that do not fit each other.
    """
    skops = _skops()
    try:
        data = base64.b64decode(text, validate=True)
        _refuse_unpacking(data)
        foreign = sorted(set(skops.get_untrusted_types(data=data)) - set(TRUSTED))
        if foreign:
            raise ValueError(f"it holds types that no model of ours needs: {', '.join(foreign)[:200]}")
        estimator = skops.loads(data, trusted=list(TRUSTED))
    except (ValueError, binascii.Error):
        raise
    except Exception as error:  # skops can raise anything on a broken archive
        raise ValueError(f"it is not an estimator ({type(error).__name__}: {error})") from error
    if type(estimator) is not type(expected) or getattr(estimator, "n_features_in_", None) != features:
        raise ValueError(f"it is no {type(expected).__name__} of {features} features")
    refuse_misfit(estimator, expected)
    return estimator


def _refuse_unpacking(data: bytes) -> None:
    """Raise ValueError for an archive that takes more memory than its own size, in files or in arrays."""
    try:
        with ZipFile(BytesIO(data)) as archive:
            parts = archive.infolist()
            if any(part.compress_type != ZIP_STORED for part in parts):
                raise ValueError("it is compressed")
            if sum(part.file_size for part in parts) > len(data):
                raise ValueError("its parts are larger than the whole")
            for part in parts:
                if part.filename.endswith(".npy"):
                    _refuse_array(archive.read(part))
    except BadZipFile as error:
        raise ValueError(f"it is not an archive ({error})") from error


def _refuse_array(data: bytes) -> None:
    """Raise ValueError for an array whose declared size is not that of its data."""
    stream = BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in read_header:
        raise ValueError(f"an array of it has the format {version}")
    shape, _, kind = read_header[version](stream)
    if kind.hasobject or math.prod(shape) * kind.itemsize != len(data) - stream.tell():
        raise ValueError("an array of it is not as long as it says")


def _skops() -> Any:
    try:
        import skops.io
    except ImportError as error:
        raise PluginUnavailable(HINT) from error
    return skops.io
