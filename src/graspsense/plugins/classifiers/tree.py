"""The decision tree of scikit-learn (CART)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.classifier_api import Reason, SplitTest, leaf_reason, path_reasons
from graspsense.plugin_api import FeatureTable, setting
from graspsense.plugins.classifiers.scikit import (
    ExplainedTrial,
    FittedEstimator,
    KeptConfig,
    ScikitClassifier,
)


@frozen(kw_only=True)
class CartConfig(KeptConfig):
    """Settings of the tree."""

    criterion: Literal["entropy", "gini"] = setting(
        default="entropy",
        meaning="The impurity by which splits are chosen.",
    )
    min_leaf: int = setting(
        default=2, minimum=1, maximum=1_000_000_000, meaning="Smallest number of training trials at a leaf."
    )


class Cart(ScikitClassifier[CartConfig]):
    """A binary tree without pruning."""

    def estimator(self, seed: int, trials: int) -> Any:
        """Return the tree."""
        from sklearn.tree import DecisionTreeClassifier

        return DecisionTreeClassifier(
            criterion=self.config.criterion, min_samples_leaf=self.config.min_leaf, random_state=seed
        )

    def reasons(self, trial: ExplainedTrial) -> Sequence[Reason]:
        """Return the path through the tree, with thresholds in the units of the features."""
        fitted, row, scaling = trial.fitted, trial.row, trial.fitted.scaling
        inner = fitted.estimator.tree_
        nodes = fitted.estimator.decision_path(row).indices.tolist()
        tests = []
        for node in nodes[:-1]:
            k = int(inner.feature[node])
            tests.append(
                SplitTest(
                    feature=fitted.table.names[k],
                    unit=fitted.table.units[k],
                    value=float(row[0, k] * scaling.scale[k] + scaling.origin[k]),
                    threshold=float(inner.threshold[node] * scaling.scale[k] + scaling.origin[k]),
                    above=bool(row[0, k] > inner.threshold[node]),
                )
            )
        return (*path_reasons(tests), leaf_reason(*self.counted(fitted, row), trial.label))

    def support(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return the training trials in the leaf of each trial."""
        fitted = self._model()
        rows = fitted.scaling.ready(table.columns(fitted.table.names).values)
        inner = fitted.estimator.tree_
        return np.asarray(inner.n_node_samples[fitted.estimator.apply(rows)], dtype=np.float64)

    def counted(self, fitted: FittedEstimator, row: NDArray[np.float64]) -> tuple[float, float]:
        """Return how many training trials in the leaf have its most frequent label, and how many there are."""
        inner, leaf = fitted.estimator.tree_, int(fitted.estimator.apply(row)[0])
        trials = int(inner.n_node_samples[leaf])
        shares = inner.value[leaf]
        return float(round(trials * shares.max() / shares.sum())), float(trials)
