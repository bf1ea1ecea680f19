"""The plain form of the builder."""

from __future__ import annotations

from graspsense_c45.nodewise.collapsing import collapse
from graspsense_c45.nodewise.growing import grow
from graspsense_c45.nodewise.pruning import prune_pessimistic
from graspsense_c45.training_set import TrainingSet


class NodewiseTreeBuilder:
    """Grows a tree when it is made; see `fitting.TreeBuilder`. It builds every tree."""

    def __init__(self, training: TrainingSet) -> None:
        self._training = training
        self.tree = grow(training)

    def collapse(self) -> None:
        """Make leaves of subtrees that hardly save training errors."""
        collapse(self.tree, self._training)

    def prune_pessimistic(self) -> None:
        """Prune by estimated errors."""
        prune_pessimistic(self.tree, self._training)
