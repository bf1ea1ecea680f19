"""Whether the arrays of a fitted estimator of scikit-learn fit each other, before anything is predicted with it.

The compiled code of trees and support vector machines trusts the sizes and indices that it is given. An estimator that
was read from a file is therefore compared with an unfitted one that has the settings of the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, Final

_OF_TRAINING: Final = frozenset({"max_iter"})
"""Parameters that change nothing in a prediction, and that earlier versions set otherwise."""
_LARGEST: Final = 1e100


def refuse_misfit(estimator: Any, expected: Any) -> None:
    """Raise ValueError if the estimator does not have the settings of the unfitted one, or its arrays do not fit.

    Both are of the same class, one of those that a model can keep as fitted.
    """
    try:
        for name, value in expected.get_params(deep=False).items():
            given = getattr(estimator, name)
            if name not in _OF_TRAINING and (type(given) is not type(value) or given != value):
                raise ValueError(f"{name} is not that of the settings")
        labels = estimator.classes_
        if labels.ndim != 1 or labels.dtype.kind != "U" or not 2 <= len(set(labels.tolist())) == len(labels):
            raise ValueError("its labels are not different texts")
        _CHECKS[type(estimator).__name__](estimator, len(labels))
    except (AttributeError, IndexError, KeyError, TypeError, OverflowError) as error:
        raise ValueError(f"its parts do not fit each other ({type(error).__name__}: {error})") from error


def _refuse_tree(estimator: Any, labels: int) -> None:
    tree, features = estimator.tree_, estimator.n_features_in_
    count, left, right = int(tree.node_count), tree.children_left, tree.children_right
    if tree.n_features != features or estimator.n_outputs_ != 1 or estimator.n_classes_ != labels:
        raise ValueError("a tree of it has other numbers of features or labels")
    if count < 1 or tree.value.shape != (count, 1, labels):
        raise ValueError("a tree of it does not have shares of each label at each node")
    inner = left >= 0
    if sorted([*left[inner].tolist(), *right[inner].tolist()]) != list(range(1, count)):
        raise ValueError("a tree of it leads nowhere, or twice to the same node")
    if (left[~inner] != -1).any() or (right[~inner] != -1).any():
        raise ValueError("a tree of it leads nowhere")
    parents = inner.nonzero()[0]
    if (left[inner] <= parents).any() or (right[inner] <= parents).any():
        raise ValueError("a tree of it leads back")
    if ((tree.feature[inner] < 0) | (tree.feature[inner] >= features)).any():
        raise ValueError("a tree of it asks for a feature that is not there")
    _refuse_numbers("thresholds of a tree", tree.threshold[inner], (len(parents),))
    _refuse_numbers("shares at the nodes of a tree", tree.value, (count, 1, labels), least=0.0)
    _refuse_numbers("weights of a tree", tree.weighted_n_node_samples, (count,), least=0.0)
    if (tree.value.sum(axis=2) <= 0.0).any() or (tree.n_node_samples <= 0).any():
        raise ValueError("a node of a tree of it has no training trials")


def _refuse_forest(estimator: Any, labels: int) -> None:
    trees = estimator.estimators_
    if len(trees) != estimator.n_estimators or estimator.n_outputs_ != 1 or estimator.n_classes_ != labels:
        raise ValueError("its trees, outputs or labels are not as many as it says")
    for tree in trees:
        if (
            type(tree).__name__ != _TREES[type(estimator).__name__]
            or tree.n_features_in_ != estimator.n_features_in_
        ):
            raise ValueError("one of its trees is not a tree of its features")
        if tree.classes_.shape != (labels,):
            raise ValueError("one of its trees has other labels")
        _refuse_tree(tree, labels)


def _refuse_machine(estimator: Any, labels: int) -> None:
    vectors, features = len(estimator.support_), estimator.n_features_in_
    pairs = labels * (labels - 1) // 2
    if estimator._sparse or estimator.support_.dtype != "int32" or estimator.support_.shape != (vectors,):
        raise ValueError("its support vectors are not listed")
    if (estimator.support_ < 0).any():
        raise ValueError("a support vector of it has a number below 0")
    counts = estimator._n_support
    if counts.dtype != "int32" or counts.shape != (labels,) or (counts < 0).any() or counts.sum() != vectors:
        raise ValueError("the numbers of support vectors of its labels do not add up")
    _refuse_numbers("support vectors", estimator.support_vectors_, (vectors, features))
    for name in ("dual_coef_", "_dual_coef_"):
        _refuse_numbers("dual coefficients", getattr(estimator, name), (labels - 1, vectors))
    for name in ("intercept_", "_intercept_"):
        _refuse_numbers("intercepts", getattr(estimator, name), (pairs,))
    for name in ("_probA", "_probB"):
        _refuse_numbers("probability parameters", getattr(estimator, name), (0,))
    gamma = estimator._gamma
    if not isinstance(gamma, float) or not 0.0 <= gamma <= _LARGEST or estimator.shape_fit_[1] != features:
        raise ValueError("its kernel does not fit its features")
    if estimator.fit_status_ not in (0, 1):
        raise ValueError("it was not fitted")


def _refuse_network(estimator: Any, labels: int) -> None:
    outputs = 1 if labels == 2 else labels
    sizes = (estimator.n_features_in_, *estimator.hidden_layer_sizes, outputs)
    layers = list(pairwise(sizes))
    if estimator.n_layers_ != len(sizes) or estimator.n_outputs_ != outputs:
        raise ValueError("its layers are not as many as it says")
    if len(estimator.coefs_) != len(layers) or len(estimator.intercepts_) != len(layers):
        raise ValueError("its weights are not those of its layers")
    for shape, weights, intercepts in zip(layers, estimator.coefs_, estimator.intercepts_, strict=True):
        _refuse_numbers("weights", weights, shape)
        _refuse_numbers("intercepts", intercepts, shape[1:])
    if estimator.out_activation_ != ("logistic" if labels == 2 else "softmax"):
        raise ValueError("its outputs are no probabilities")
    binarizer = estimator._label_binarizer
    if (
        type(binarizer).__name__ != "LabelBinarizer"
        or binarizer.classes_.tolist() != estimator.classes_.tolist()
    ):
        raise ValueError("its outputs are not those of its labels")


def _refuse_numbers(what: str, values: Any, shape: Sequence[int], least: float = -_LARGEST) -> None:
    """Raise ValueError unless these are numbers of this shape, at least `least`, and not too large."""
    if values.shape != tuple(shape) or values.dtype.kind != "f":
        raise ValueError(f"the {what} have the shape {values.shape}, which does not fit: {tuple(shape)}")
    if not ((values >= least) & (values <= _LARGEST)).all():
        raise ValueError(f"the {what} are not finite, or not in their range")


_TREES: Final = {
    "RandomForestClassifier": "DecisionTreeClassifier",
    "ExtraTreesClassifier": "ExtraTreeClassifier",
}
_CHECKS: Final[dict[str, Callable[[Any, int], None]]] = {
    "DecisionTreeClassifier": _refuse_tree,
    "RandomForestClassifier": _refuse_forest,
    "ExtraTreesClassifier": _refuse_forest,
    "SVC": _refuse_machine,
    "MLPClassifier": _refuse_network,
}
