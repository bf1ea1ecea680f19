"""The classifier `c45` of graspsense. Importing it imports no numpy; the modules of the tree are imported on use."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from attrs import frozen

from graspsense.classifier_api import (
    CodedColumn,
    Reason,
    SplitTest,
    TreeNode,
    codes_of,
    in_words,
    leaf_reason,
    missing_feature,
    path_reasons,
    table_of,
    with_codes,
)
from graspsense.plugin_api import (
    Classifier,
    ClassifierConfig,
    ClassifierEntry,
    Features,
    FeatureTable,
    Prediction,
    hookimpl,
    setting,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense_c45.tree import Tree

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_classifiers() -> Iterable[ClassifierEntry]:
    """Return C4.5."""
    yield ClassifierEntry(
        name="c45",
        target="graspsense_c45.plugin:C45",
        summary="C4.5, equal to Weka's J48: the paper's classifier, and a tree that can be read",
    )


@frozen(kw_only=True)
class C45Config(ClassifierConfig):
    """How the tree is grown and pruned. The defaults are those of J48."""

    criterion: Literal["gain_ratio", "info_gain"] = setting(
        default="gain_ratio",
        meaning="The measure by which tests are chosen: the gain ratio, or the information gain.",
    )
    pruning: Literal["pessimistic", "reduced_error", "none"] = setting(
        default="pessimistic",
        meaning="pessimistic: by error estimates. reduced_error: by errors on held-out trials. none: no pruning.",
    )
    confidence_factor: float = setting(
        default=0.25,
        above=0.0,
        below=1.0,
        meaning="Confidence level of the pessimistic estimate; a smaller one prunes more.",
    )
    min_objects: float = setting(
        default=2.0,
        minimum=1.0,
        meaning="Least number of trials in at least two branches of a test.",
    )
    mdl_correction: bool = setting(
        default=True,
        meaning="Whether the gain of a numeric test is reduced by the cost of its threshold.",
    )
    subtree_raising: bool = setting(
        default=True,
        meaning="Whether pruning may replace a test by its largest branch.",
    )
    rep_folds: int = setting(
        default=3,
        minimum=2,
        plausible=(2, 100),
        meaning="reduced_error holds out one of this number of parts.",
    )


class C45(Classifier[C45Config]):
    """A C4.5 tree.

    If a tested feature is missing, the prediction is a mean over all branches, weighted by their training trials.
    """

    _tree: Tree | None = None

    def fit(self, table: FeatureTable, labels: Sequence[str], seed: int) -> None:
        """Grow and prune a tree; the seed is not used. Raises ValueError for data without a label."""
        from graspsense_c45.fitting import fit_scaled
        from graspsense_c45.options import Options
        from graspsense_c45.table import Attribute, Schema, make_table

        del seed
        config = self.config
        classes = tuple(sorted(set(labels)))
        columns, values = with_codes(table)
        schema = Schema(
            tuple(Attribute(column.name, column.unit, column.values) for column in columns), classes
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
        rows = make_table(schema, values, [numbers[label] for label in labels])
        self._tree = fit_scaled(rows, options)

    def classes(self) -> tuple[str, ...]:
        """Return the labels in the order of the columns of `probabilities`."""
        return tuple(str(label) for label in self._fitted().schema.classes)

    def probabilities(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the distribution at the leaf; where a feature is missing, the mean over the leaves."""
        from graspsense_c45.prediction import distributions

        tree = self._fitted()
        return distributions(tree, codes_of(_coded_columns(tree), table))

    def support(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the training trials in the leaf of each trial; NaN where a feature is missing."""
        from graspsense_c45.prediction import leaf_weights

        tree = self._fitted()
        return leaf_weights(tree, codes_of(_coded_columns(tree), table))

    def explain(self, features: Features) -> Prediction:
        """Return the prediction with the path through the tree."""
        from graspsense_c45.path import explain

        tree = self._fitted()
        columns = _coded_columns(tree)
        row = codes_of(columns, table_of([features]))[0].tolist()
        path = explain(tree, row)
        missing = [
            missing_feature(
                column.name,
                column.unit,
                f": {features.reasons.get(column.columns[0], 'no value that was trained on')}",
            )
            for column, value in zip(columns, row, strict=True)
            if math.isnan(value)
        ]
        bounds = [
            SplitTest(
                feature=test.attribute.name,
                unit=test.attribute.unit,
                value=test.value,
                threshold=test.threshold,
                above=test.above,
                share=test.share,
            )
            for test in path.tests
            if not test.attribute.is_nominal
        ]
        # Where a tested feature is missing, the probability is a mean over leaves and not the share in this one.
        one_leaf = not any(math.isnan(test.value) for test in path.tests)
        nominal = [
            Reason(words=test.words)
            for test in path.tests
            if test.attribute.is_nominal and not math.isnan(test.value)
        ]
        leaf = leaf_reason(path.with_label, path.support, str(path.label))
        return Prediction(
            label=str(path.label),
            probabilities=dict(zip(self.classes(), path.distribution, strict=True)),
            because=(*missing, *path_reasons(bounds), *nominal, leaf),
            support=(path.with_label, path.support) if one_leaf and path.support > 0 else None,
        )

    def tree(self) -> Sequence[TreeNode]:
        """Return the tree, breadth first."""
        from graspsense_c45.branch_words import branch

        tree = self._fitted()

        def words(node: int, slot: int) -> str:
            attribute = tree.attribute(node)
            if attribute.is_nominal:
                return branch(tree, node, slot)
            threshold = in_words(float(tree.splits.threshold[node]), attribute.unit)
            return f"{attribute.name} {'≤' if slot == 0 else '>'} {threshold}"

        branch_to = {
            child: (node, slot)
            for node in range(tree.node_count)
            for slot, child in enumerate(tree.children(node))
        }
        return [
            TreeNode(
                label=self.classes()[int(tree.majority_class[node])],
                trials=float(tree.weighted_n_node_samples[node]),
                wrong=float(tree.weighted_n_node_samples[node] - tree.class_weights[node].max()),
                parent=branch_to[node][0] if node in branch_to else None,
                branch=words(*branch_to[node]) if node in branch_to else "",
            )
            for node in range(tree.node_count)
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the tree as `graspsense_c45.stored` writes it."""
        from graspsense_c45.stored import to_document

        return to_document(self._fitted())

    def from_json(self, model: Mapping[str, Any]) -> None:
        """Load the tree that `to_json` returned. Raises ValueError if `model` is not a stored tree."""
        from graspsense_c45.stored import from_document

        self._tree = from_document(dict(model))

    def _fitted(self) -> Tree:
        if self._tree is None:
            raise ValueError("the tree is neither fitted nor loaded yet")
        return self._tree


def _coded_columns(tree: Tree) -> list[CodedColumn]:
    """Return the attributes of a tree as columns of a table of features."""
    return [
        CodedColumn(attribute.name, attribute.unit, attribute.values) for attribute in tree.schema.attributes
    ]
