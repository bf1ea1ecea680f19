"""The numpy engine as a builder of trees."""

from __future__ import annotations

from graspsense_c45.levelwise.collapsing import collapse
from graspsense_c45.levelwise.growing import grow
from graspsense_c45.levelwise.pessimistic import prune_pessimistic
from graspsense_c45.levelwise.unweighted_level import UnweightedLevel
from graspsense_c45.levelwise.weighted_level import WeightedLevel
from graspsense_c45.training_set import TrainingSet


class LevelwiseTreeBuilder:
    """Grows a tree when it is made; see `fitting.TreeBuilder`. It builds every tree."""

    def __init__(self, training: TrainingSet) -> None:
        level = UnweightedLevel(training) if training.unit else WeightedLevel(training)
        self._training = training
        self.tree = grow(training, level)
        self._leaf_of_row = level.leaf_of_row

    def collapse(self) -> None:
        """Make leaves of subtrees that hardly save training errors."""
        collapse(self.tree, self._training, self._leaf_of_row)

    def prune_pessimistic(self) -> None:
        """Prune by estimated errors."""
        prune_pessimistic(self.tree, self._training, self._leaf_of_row)
