"""A fitted estimator of scikit-learn as text, by skops: without pickle, and with listed types only.

skops is the extra `skops`. What its own list of safe types lacks is `TRUSTED`; a file that holds any other type is
refused before anything of it is made.
"""

from __future__ import annotations

import base64
import binascii
from typing import Any, Final

from graspsense.plugin_api import PluginUnavailable

TRUSTED: Final = ("sklearn.tree._tree.Tree",)
"""Types that the estimators need beyond those that skops regards as safe: the arrays of a decision tree."""
HINT: Final = (
    'a model kept as skops needs skops.\n  in a clone: pip install -e ".[skops]"     published: '
    'pip install "graspsense[skops]"'
)


def as_text(estimator: Any) -> str:
    """Return a fitted estimator as text. Raises PluginUnavailable without skops."""
    return base64.b64encode(_skops().dumps(estimator)).decode("ascii")


def from_text(text: str, kind: type, features: int) -> Any:
    """Return the fitted estimator, which must be of this class and have this number of features.

    Raises PluginUnavailable without skops, ValueError for any other object or a type that is not listed.
    """
    skops = _skops()
    try:
        data = base64.b64decode(text, validate=True)
        foreign = sorted(set(skops.get_untrusted_types(data=data)) - set(TRUSTED))
        if foreign:
            raise ValueError(f"it holds types that no model of ours needs: {', '.join(foreign)[:200]}")
        estimator = skops.loads(data, trusted=list(TRUSTED))
    except (ValueError, binascii.Error):
        raise
    except Exception as error:  # skops can raise anything on a broken archive
        raise ValueError(f"it is not an estimator ({type(error).__name__}: {error})") from error
    if type(estimator) is not kind or getattr(estimator, "n_features_in_", None) != features:
        raise ValueError(f"it is no {kind.__name__} of {features} features")
    for one in getattr(estimator, "estimators_", [estimator]):
        if hasattr(one, "tree_"):
            _check_tree(one.tree_, features)
    return estimator


def _check_tree(tree: Any, features: int) -> None:
    """Refuse a tree with indices outside its arrays, which compiled code does not check. Raises ValueError."""
    n, left, right = tree.node_count, tree.children_left, tree.children_right
    inner = left >= 0
    for k, child in enumerate(zip(left.tolist(), right.tolist(), strict=True)):
        if child != (-1, -1) and not all(k < one < n for one in child):
            raise ValueError("a tree of it leads nowhere")
    if ((tree.feature[inner] < 0) | (tree.feature[inner] >= features)).any():
        raise ValueError("a tree of it asks for a feature that is not there")


def _skops() -> Any:
    try:
        import skops.io
    except ImportError as error:
        raise PluginUnavailable(HINT) from error
    return skops.io
