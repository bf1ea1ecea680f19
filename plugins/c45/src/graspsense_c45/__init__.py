"""C4.5 decision trees, equal to those of Weka's J48 to the bit.

A name is imported when it is first used; importing the package imports neither numpy nor scikit-learn.
`C45Classifier` is a scikit-learn estimator; everything else needs numpy and attrs only.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from graspsense_c45.arff import ArffError as ArffError
    from graspsense_c45.arff import parse_arff as parse_arff
    from graspsense_c45.arff import read_arff as read_arff
    from graspsense_c45.classifier import C45Classifier as C45Classifier
    from graspsense_c45.drawing import draw as draw
    from graspsense_c45.fitting import fit as fit
    from graspsense_c45.options import J48 as J48
    from graspsense_c45.options import PAPER as PAPER
    from graspsense_c45.options import Options as Options
    from graspsense_c45.path import Path as Path
    from graspsense_c45.path import explain as explain
    from graspsense_c45.prediction import class_indices as class_indices
    from graspsense_c45.prediction import distributions as distributions
    from graspsense_c45.stored import StoredTreeError as StoredTreeError
    from graspsense_c45.stored import from_document as from_document
    from graspsense_c45.stored import from_json as from_json
    from graspsense_c45.stored import to_document as to_document
    from graspsense_c45.stored import to_json as to_json
    from graspsense_c45.table import Attribute as Attribute
    from graspsense_c45.table import Schema as Schema
    from graspsense_c45.table import Table as Table
    from graspsense_c45.table import make_table as make_table
    from graspsense_c45.text import Rule as Rule
    from graspsense_c45.text import to_dot as to_dot
    from graspsense_c45.text import to_rules as to_rules
    from graspsense_c45.text import to_text as to_text
    from graspsense_c45.tree import Tree as Tree
    from graspsense_c45.tree import feature_importances as feature_importances
    from graspsense_c45.weka_folds import Fold as Fold
    from graspsense_c45.weka_folds import JavaRandom as JavaRandom
    from graspsense_c45.weka_folds import hold_out as hold_out
    from graspsense_c45.weka_folds import stratified_folds as stratified_folds

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

__all__ = sorted(_HOME_OF)


def __getattr__(name: str) -> Any:
    """Load a public name from its module."""
    if name in _HOME_OF:
        return getattr(import_module(f"graspsense_c45.{_HOME_OF[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
