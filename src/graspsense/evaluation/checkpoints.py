"""Recognition at checkpoints of a grasp: the models of the checkpoints, and what an early end costs and saves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from attrs import evolve

from graspsense.core.model import Model, checkpoint_model, train
from graspsense.evaluation.doubt import calibrated_sets

if TYPE_CHECKING:
    from graspsense.core.checkpoints import CheckpointTrials
    from graspsense.core.config import SelectedComponent


def checkpoint_models(
    whole: Model, learner: SelectedComponent, parts: Sequence[CheckpointTrials], seed: int
) -> tuple[tuple[float, Model], ...]:
    """Return a model for each checkpoint, trained and calibrated on the same part of the trials that reach it.

    Raises ConfigError if nothing can be learned from them.
    """
    models = []
    for part in parts:
        assert part.after_s is not None
        labelled = part.labelled
        model = train(
            learner.component, learner.config, labelled, name=whole.name, seed=seed, target=whole.target
        )
        model = evolve(model, sets=calibrated_sets(learner, labelled, seed))
        models.append((part.after_s, checkpoint_model(whole, part.after_s, model)))
    return tuple(models)
