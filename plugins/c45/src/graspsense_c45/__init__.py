"""C4.5 decision trees, equal to those of Weka's J48 to the bit.

A name is imported when it is first used; importing the package imports neither numpy nor scikit-learn.
`C45Classifier` is a scikit-learn estimator; everything else needs numpy and attrs only.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from graspsense_c45.arff import ArffError, parse_arff, read_arff
    from graspsense_c45.classifier import C45Classifier
    from graspsense_c45.drawing import draw
    from graspsense_c45.fitting import fit
    from graspsense_c45.options import J48, PAPER, Options
    from graspsense_c45.path import Path, explain
    from graspsense_c45.prediction import class_indices, distributions
    from graspsense_c45.stored import StoredTreeError, from_document, from_json, to_document, to_json
    from graspsense_c45.table import Attribute, Schema, Table, make_table
    from graspsense_c45.text import Rule, to_dot, to_rules, to_text
    from graspsense_c45.tree import Tree, feature_importances
    from graspsense_c45.weka_folds import Fold, JavaRandom, hold_out, stratified_folds

_HOMES = {
    "arff": ("ArffError", "parse_arff", "read_arff"),
    "classifier": ("C45Classifier",),
    "drawing": ("draw",),
    "fitting": ("fit",),
    "options": ("J48", "PAPER", "Options"),
    "path": ("Path", "explain"),
    "prediction": ("class_indices", "distributions"),
    "stored": ("StoredTreeError", "from_document", "from_json", "to_document", "to_json"),
    "table": ("Attribute", "Schema", "Table", "make_table"),
    "text": ("Rule", "to_dot", "to_rules", "to_text"),
    "tree": ("Tree", "feature_importances"),
    "weka_folds": ("Fold", "JavaRandom", "hold_out", "stratified_folds"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "J48",
    "PAPER",
    "ArffError",
    "Attribute",
    "C45Classifier",
    "Fold",
    "JavaRandom",
    "Options",
    "Path",
    "Rule",
    "Schema",
    "StoredTreeError",
    "Table",
    "Tree",
    "class_indices",
    "distributions",
    "draw",
    "explain",
    "feature_importances",
    "fit",
    "from_document",
    "from_json",
    "hold_out",
    "make_table",
    "parse_arff",
    "read_arff",
    "stratified_folds",
    "to_document",
    "to_dot",
    "to_json",
    "to_rules",
    "to_text",
]


def __getattr__(name: str) -> Any:
    """Load a public name from its module."""
    if name in _HOME_OF:
        return getattr(import_module(f"graspsense_c45.{_HOME_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
