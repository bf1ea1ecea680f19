"""C4.5 as a scikit-learn estimator (needs the extra ``sklearn``)."""

# ruff: noqa: N803 (the name X is scikit-learn's)

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
from attrs import fields
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils import check_random_state
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import _check_sample_weight, check_is_fitted, column_or_1d, validate_data

from graspsense_c45.arrays import AnyArray, Indices, Reals
from graspsense_c45.drawing import draw
from graspsense_c45.fitting import fit
from graspsense_c45.options import PAPER, Options
from graspsense_c45.path import Path, explain
from graspsense_c45.prediction import class_indices, distributions
from graspsense_c45.stored import from_json, to_json
from graspsense_c45.table import Attribute, Schema, make_table
from graspsense_c45.text import Rule, to_dot, to_rules, to_text
from graspsense_c45.tree import Tree, feature_importances
from graspsense_c45.weka_folds import hold_out

_OPTIONS = tuple(field.name for field in fields(Options))


class C45Classifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]
    """A C4.5 decision tree, equal to that of J48, whose defaults it has.

    criterion, pruning, confidence_factor, min_objects, collapse, subtree_raising, mdl_correction, actual_split_value,
    laplace, binary_splits, rep_folds: see ``Options``.
    classes: the declared classes in order; a class need not occur (the number of classes enters the least weight of a
        branch). By default those that occur, sorted.
    nominal: the nominal columns, as a boolean mask, indices or names; by default the categorical columns of a
        data frame. A value that did not occur in fitting is treated as missing.
    units: the units of the columns, as a mapping of names or a sequence, for paths and rules.
    random_state: with ``reduced_error`` pruning, an integer or a RandomState shuffles the rows before some are held
        out; None keeps their order, as J48 does (whose seed does not decide which rows are held out).
    engine: ``plain``, ``fast`` (compiled; needs the extra ``fast``) or ``auto``; the tree is the same.

    After fitting: ``tree_`` (a `tree.Tree`), ``classes_``, ``n_features_in_``, ``feature_names_in_`` where X has names.
    NaN in X is missing; so are None and NA in a data frame.
    """

    def __init__(
        self,
        criterion: str = "gain_ratio",
        pruning: str = "pessimistic",
        confidence_factor: float = 0.25,
        min_objects: float = 2,
        collapse: bool = True,
        subtree_raising: bool = True,
        mdl_correction: bool = True,
        actual_split_value: bool = True,
        laplace: bool = False,
        binary_splits: bool = False,
        rep_folds: int = 3,
        classes: Sequence[Any] | None = None,
        nominal: Sequence[Any] | None = None,
        units: Mapping[str, str] | Sequence[str] | None = None,
        random_state: Any = None,
        engine: str = "auto",
    ) -> None:
        self.criterion = criterion
        self.pruning = pruning
        self.confidence_factor = confidence_factor
        self.min_objects = min_objects
        self.collapse = collapse
        self.subtree_raising = subtree_raising
        self.mdl_correction = mdl_correction
        self.actual_split_value = actual_split_value
        self.laplace = laplace
        self.binary_splits = binary_splits
        self.rep_folds = rep_folds
        self.classes = classes
        self.nominal = nominal
        self.units = units
        self.random_state = random_state
        self.engine = engine

    @classmethod
    def j48(cls, **changes: Any) -> Self:
        """Return an estimator with J48's defaults and these changes."""
        return cls(**changes)

    @classmethod
    def paper(cls, **changes: Any) -> Self:
        """Return an estimator as Chitta et al. (2010) describe it, with these changes; see `options.PAPER`."""
        return cls(**({name: getattr(PAPER, name) for name in _OPTIONS} | changes))

    @classmethod
    def from_tree(cls, tree: Tree) -> Self:
        """Return a fitted estimator that predicts with this tree."""
        classifier = cls(laplace=tree.laplace, classes=list(tree.schema.classes))
        classifier._adopt(tree, np.array(tree.schema.classes))
        classifier.n_features_in_ = len(tree.schema.attributes)
        classifier._categories = [
            None if attribute.values is None else list(attribute.values)
            for attribute in tree.schema.attributes
        ]
        return classifier

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Return a fitted estimator that predicts with the stored tree. Raises StoredTreeError."""
        return cls.from_tree(from_json(text))

    def fit(
        self, X: Any, y: ArrayLike, sample_weight: ArrayLike | None = None, holdout: ArrayLike | None = None
    ) -> Self:
        """Grow and prune the tree.

        holdout: with ``reduced_error`` pruning, the rows of X to prune on (a boolean mask or indices), instead of the
        last of ``rep_folds`` stratified folds.

        Raises ValueError for data that a tree cannot be fitted to; the message says why.
        """
        options = Options(**{name: getattr(self, name) for name in _OPTIONS})
        values = self._encode(X, fitting=True)
        labels, classes = self._encode_labels(y, len(values))
        weights = (
            None if sample_weight is None else _check_sample_weight(sample_weight, values, dtype=np.float64)
        )
        schema = Schema(tuple(self._attributes()), tuple(classes.tolist()))
        table = make_table(schema, values, labels, weights)
        held_out = None if holdout is None else _row_indices(holdout, len(values))
        if held_out is None and options.pruning == "reduced_error" and self.random_state is not None:
            order = check_random_state(self.random_state).permutation(len(values))
            held_out = order[hold_out(labels[order], options.rep_folds)]
        self._adopt(fit(table, options, held_out, self.engine), classes)  # type: ignore[arg-type]
        return self

    def predict(self, X: Any) -> AnyArray:
        """Return the class of each row, as J48 classifies; `laplace` changes probabilities only."""
        check_is_fitted(self)
        values = self._encode(X, fitting=False)
        labels: AnyArray = self.classes_[class_indices(self.tree_, values)]
        return labels

    def predict_proba(self, X: Any) -> Reals:
        """Return the probability of each class for each row, in the order of ``classes_``."""
        check_is_fitted(self)
        return distributions(self.tree_, self._encode(X, fitting=False))

    def explain(self, X: Any) -> list[Path]:
        """Return the path of each row through the tree, in words and units."""
        check_is_fitted(self)
        return [explain(self.tree_, row) for row in self._encode(X, fitting=False)]

    @property
    def feature_importances_(self) -> Reals:
        """The fraction of each column in the information gain; see `importances.feature_importances`."""
        check_is_fitted(self)
        return feature_importances(self.tree_)

    def to_dict(self) -> dict[str, Any]:
        """Return the tree as nested dictionaries; see `tree.Tree.to_dict`."""
        check_is_fitted(self)
        return self.tree_.to_dict()

    def to_json(self) -> str:
        """Return the tree as JSON."""
        check_is_fitted(self)
        return to_json(self.tree_)

    def to_text(self) -> str:
        """Return the tree as J48 prints it."""
        check_is_fitted(self)
        return to_text(self.tree_)

    def to_rules(self) -> tuple[Rule, ...]:
        """Return the tree as rules, one per leaf."""
        check_is_fitted(self)
        return to_rules(self.tree_)

    def to_dot(self) -> str:
        """Return the tree in the DOT language."""
        check_is_fitted(self)
        return to_dot(self.tree_)

    def draw(self, axes: Any = None) -> Any:
        """Draw the tree with matplotlib; return the axes."""
        check_is_fitted(self)
        return draw(self.tree_, axes)

    def __sklearn_tags__(self) -> Any:
        """Return the tags: NaN is allowed, and means missing."""
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags

    def _adopt(self, tree: Tree, classes: AnyArray) -> None:
        self.tree_ = tree
        self.classes_ = classes

    def _attributes(self) -> list[Attribute]:
        names = getattr(self, "feature_names_in_", None)
        names = (
            [f"x{i}" for i in range(self.n_features_in_)] if names is None else [str(name) for name in names]
        )
        if self.units is None:
            units = [""] * len(names)
        elif isinstance(self.units, Mapping):
            units = [self.units.get(name, "") for name in names]
        else:
            units = list(self.units)
        if len(units) != len(names):
            raise ValueError(f"{len(units)} units; there are {len(names)} columns")
        return [
            Attribute(name, unit, None if categories is None else tuple(map(str, categories)))
            for name, unit, categories in zip(names, units, self._categories, strict=True)
        ]

    def _encode_labels(self, y: ArrayLike, n_rows: int) -> tuple[Indices, AnyArray]:
        labels = column_or_1d(y, warn=True)
        if labels.dtype.kind not in "biu":
            # The check is slow, and it can find nothing wrong with integers.
            check_classification_targets(y)
        if len(labels) != n_rows:
            raise ValueError(f"{len(labels)} labels for {n_rows} rows; give one label per row")
        try:
            present, codes = np.unique(labels, return_inverse=True)
        except TypeError:
            raise ValueError(
                "labels of different types cannot be sorted; use strings only, or integers only"
            ) from None
        if self.classes is None:
            return codes, present
        declared = np.asarray(self.classes)
        place = {label: i for i, label in enumerate(declared.tolist())}
        unknown = [label for label in present.tolist() if label not in place]
        if unknown or len(place) != len(declared):
            raise ValueError(f"classes must be distinct and hold every label; not among them: {unknown}")
        return np.array([place[label] for label in present.tolist()])[codes], declared

    def _encode(self, X: Any, fitting: bool) -> Reals:
        """Return the values as numbers, nominal ones as the index of their category."""
        if fitting:
            self._nominal_columns = _nominal_columns(X, self.nominal)
            self._categories: list[list[Any] | None] = []
        if not (self._nominal_columns if fitting else any(c is not None for c in self._categories)):
            numbers: Reals = validate_data(
                self, X, reset=fitting, dtype=np.float64, order="C", ensure_all_finite="allow-nan"
            )
            if fitting:
                self._categories = [None] * numbers.shape[1]
            return numbers
        validate_data(self, X, reset=fitting, skip_check_array=True)
        columns = _columns(X)
        if fitting:
            self._categories = [
                _categories(column) if i in self._nominal_columns else None
                for i, column in enumerate(columns)
            ]
        encoded = [
            _numbers(column, i) if categories is None else _codes(column, categories)
            for i, (column, categories) in enumerate(zip(columns, self._categories, strict=True))
        ]
        return np.column_stack(encoded)


def _row_indices(rows: ArrayLike, n_rows: int) -> Indices:
    chosen = np.asarray(rows)
    if chosen.dtype == bool:
        chosen = np.flatnonzero(chosen) if chosen.shape == (n_rows,) else np.array([n_rows])
    if not chosen.size or chosen.min() < 0 or chosen.max() >= n_rows:
        raise ValueError(
            f"holdout must name some of the rows 0..{n_rows - 1}, or be a mask of {n_rows} booleans"
        )
    return chosen.astype(np.int64)


def _nominal_columns(X: Any, nominal: Sequence[Any] | None) -> set[int]:
    names = [str(name) for name in X.columns] if hasattr(X, "columns") else []
    if nominal is None:
        return {i for i, kind in enumerate(X.dtypes) if str(kind) == "category"} if names else set()
    asked, columns = np.asarray(nominal), np.arange(np.shape(X)[-1])
    if asked.dtype.kind == "U":
        missing = [name for name in asked.tolist() if name not in names]
        if missing:
            raise ValueError(
                f"nominal names no columns: {missing}; the columns are {names or 'without names'}"
            )
        return {names.index(name) for name in asked.tolist()}
    if asked.dtype == bool and asked.shape == columns.shape:
        asked = columns[asked]
    if asked.dtype == bool or not np.isin(asked, columns).all():
        raise ValueError(
            f"nominal is {list(nominal)}: name some of the columns 0..{len(columns) - 1}, or give a mask of "
            f"{len(columns)} booleans"
        )
    return {int(column) for column in asked}


def _columns(X: Any) -> list[Any]:
    if hasattr(X, "iloc"):
        return [X.iloc[:, i] for i in range(X.shape[1])]
    array = np.asarray(X, dtype=object) if not hasattr(X, "dtype") else np.asarray(X)
    if array.ndim != 2:
        raise ValueError(f"X has the shape {array.shape}; expected (rows, columns)")
    return [array[:, i] for i in range(array.shape[1])]


def _is_missing(value: Any) -> bool:
    # NaN and NaT of pandas are not equal to themselves; a comparison with NA of pandas is not a boolean.
    return value is None or type(value).__name__ == "NAType" or bool(value != value)


def _categories(column: Any) -> list[Any]:
    """Return the declared categories of a categorical column, else the values that occur, sorted."""
    if hasattr(column, "cat"):
        return list(column.cat.categories)
    present = {value for value in column.tolist() if not _is_missing(value)}
    try:
        return sorted(present)
    except TypeError:
        raise ValueError(
            f"a nominal column holds values of different types: {sorted(map(repr, present))}"
        ) from None


def _codes(column: Any, categories: list[Any]) -> Reals:
    place = {value: float(code) for code, value in enumerate(categories)}
    return np.array([place.get(value, float("nan")) for value in column.tolist()])


def _numbers(column: Any, index: int) -> Reals:
    try:
        return np.array([float("nan") if _is_missing(value) else float(value) for value in column.tolist()])
    except (TypeError, ValueError):
        raise ValueError(
            f"column {index} holds text; make it categorical or list it in nominal (numbers are tested by size)"
        ) from None
