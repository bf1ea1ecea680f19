"""The classifier `c45` of graspsense: the only module here that knows graspsense.

Light to import: the tree itself is imported when one is grown or asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from attrs import field, frozen
from attrs.validators import and_, ge, gt, in_, lt

from graspsense.plugin_api import (
    Classifier,
    ClassifierConfig,
    ClassifierEntry,
    Features,
    FeatureTable,
    Prediction,
    hookimpl,
    in_words,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense_c45.tree import Tree

GRASPSENSE_API = (1, 0)


@hookimpl
def graspsense_classifiers() -> Iterable[ClassifierEntry]:
    """Return C4.5."""
    yield ClassifierEntry(
        name="c45",
        target="graspsense_c45.plugin:C45",
        config="graspsense_c45.plugin:C45Config",
        summary="C4.5, equal to Weka's J48: the paper's classifier, and a tree that can be read",
    )


@frozen(kw_only=True)
class C45Config(ClassifierConfig):
    """How the tree is grown and pruned; the defaults are J48's."""

    criterion: Literal["gain_ratio", "info_gain"] = field(
        default="gain_ratio", validator=in_(("gain_ratio", "info_gain"))
    )
    pruning: Literal["pessimistic", "reduced_error", "none"] = field(
        default="pessimistic", validator=in_(("pessimistic", "reduced_error", "none"))
    )
    """`pessimistic`: by error estimates; `reduced_error`: by errors on held-out trials."""
    confidence_factor: float = field(default=0.25, validator=and_(gt(0.0), lt(1.0)))
    """Of the pessimistic estimate; smaller prunes more."""
    min_objects: float = field(default=2.0, validator=ge(1.0))
    """Least number of trials in at least two branches."""
    mdl_correction: bool = True
    """Whether a split on a number pays for the choice of its threshold."""
    subtree_raising: bool = True
    rep_folds: int = field(default=3, validator=ge(2))
    """`reduced_error` holds out one part in so many."""


class C45(Classifier[C45Config]):
    """A C4.5 tree. A missing feature goes down all branches, in proportion to their training trials."""

    _tree: Tree | None = None

    def fit(self, table: FeatureTable, labels: Sequence[str], seed: int) -> None:
        """Grow and prune a tree; nothing in it is drawn at random. Raises ValueError."""
        from graspsense_c45.fitting import fit
        from graspsense_c45.options import Options
        from graspsense_c45.schema import Attribute, Schema
        from graspsense_c45.table import make_table

        del seed
        config = self.config
        classes = tuple(sorted(set(labels)))
        schema = Schema(
            tuple(Attribute(name, unit) for name, unit in zip(table.names, table.units, strict=True)), classes
        )
        numbers = {label: k for k, label in enumerate(classes)}
        options = Options(
            criterion=config.criterion,
            pruning=config.pruning,
            confidence_factor=config.confidence_factor,
            min_objects=config.min_objects,
            collapse=config.pruning != "reduced_error",
            subtree_raising=config.subtree_raising,
            mdl_correction=config.mdl_correction,
            rep_folds=config.rep_folds,
        )
        rows = make_table(schema, table.values, [numbers[label] for label in labels])
        self._tree = fit(rows, options)

    def classes(self) -> tuple[str, ...]:
        """Return the labels in the order of the columns of `probabilities`."""
        return tuple(str(label) for label in self._fitted().schema.classes)

    def probabilities(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the distribution at the leaf, or over the leaves where something is missing."""
        from graspsense_c45.prediction import distributions

        tree = self._fitted()
        return distributions(tree, table.columns([one.name for one in tree.schema.attributes]).values)

    def explain(self, features: Features) -> Prediction:
        """Return the prediction with the path through the tree."""
        import numpy as np

        from graspsense_c45.prediction import class_indices, distributions

        tree = self._fitted()
        row = np.array([[features[one.name] for one in tree.schema.attributes]])
        shares = distributions(tree, row)[0].tolist()
        label = self.classes()[int(class_indices(tree, row)[0])]
        return Prediction(
            label=label,
            probabilities=dict(zip(self.classes(), shares, strict=True)),
            because=tuple(_path(tree, features)),
        )

    def to_json(self) -> dict[str, Any]:
        """Return the tree's nodes, breadth first: what each tests, and the training weight of each class."""
        tree = self._fitted()
        tests = tree.tests
        return {
            "classes": list(tree.schema.classes),
            "attributes": [[one.name, one.unit] for one in tree.schema.attributes],
            "laplace": tree.laplace,
            "attribute": tests.attribute.tolist(),
            "threshold": [None if math.isnan(one) else one for one in tests.threshold.tolist()],
            "weights": [{str(k): w for k, w in enumerate(row) if w} for row in tree.weights.tolist()],
        }

    def from_json(self, model: Mapping[str, Any]) -> None:
        """Become the tree that `to_json` gave. Raises KeyError, TypeError or ValueError where it is none."""
        import numpy as np

        from graspsense_c45.branches import ALL_VALUES, LEAF, Tests
        from graspsense_c45.schema import Attribute, Schema
        from graspsense_c45.tree import Tree

        schema = Schema(
            tuple(Attribute(str(name), str(unit)) for name, unit in model["attributes"]),
            tuple(str(one) for one in model["classes"]),
        )
        attribute = np.array(model["attribute"], dtype=np.int32)
        threshold = np.array(
            [math.nan if one is None else float(one) for one in model["threshold"]], dtype=np.float64
        )
        weights = np.zeros((len(attribute), len(schema.classes)))
        for i, row in enumerate(model["weights"]):
            for k, weight in row.items():
                weights[i, int(k)] = float(weight)
        inner = attribute != LEAF
        n_sons = np.where(inner, 2, 0).astype(np.int32)
        first_son = np.where(inner, 1 + np.cumsum(n_sons) - n_sons, 0).astype(np.int32)
        if (
            len(attribute) != 1 + int(n_sons.sum())
            or len(threshold) != len(attribute)
            or len(model["weights"]) != len(attribute)
            or attribute.min() < LEAF
            or attribute.max() >= len(schema.attributes)
            or bool(np.isnan(threshold[inner]).any())
            # A node's sons come behind it: without that a walk down the tree would not end.
            or bool((first_son[inner] <= np.flatnonzero(inner)).any())
        ):
            raise ValueError("its nodes do not make a tree")
        value = np.full(len(attribute), ALL_VALUES, dtype=np.int32)
        tests = Tests(attribute, threshold, value, first_son, n_sons)
        self._tree = Tree(schema, tests, weights, bool(model["laplace"]))

    def _fitted(self) -> Tree:
        if self._tree is None:
            raise ValueError("the tree is neither fitted nor loaded yet")
        return self._tree


def _path(tree: Tree, features: Features) -> Iterator[str]:
    """Yield one sentence a test on the way down, and one on the leaf; where a feature is missing, the heavier way."""
    node = 0
    while not tree.is_leaf(node):
        one = tree.attribute(node)
        at_most, above = tree.sons(node)
        value, threshold = features[one.name], float(tree.tests.threshold[node])
        if math.isnan(value):
            why = features.reasons.get(one.name, "missing")
            node = at_most if tree.weight[at_most] >= tree.weight[above] else above
            yield f"{one.name} is missing ({why}): both ways counted, the likelier one followed here"
            continue
        sign = "<=" if value <= threshold else ">"
        yield f"{one.name} = {in_words(value, one.unit)} {sign} {in_words(threshold, one.unit)}"
        node = at_most if value <= threshold else above
    majority = int(tree.majority[node])
    right, total = float(tree.weights[node, majority]), float(tree.weight[node])
    yield f"{right:g} of the {total:g} training trials that came here were {tree.schema.classes[majority]}"
