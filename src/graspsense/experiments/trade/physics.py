"""The task `physics`: train on grasps of a model with a parameter error, and test on grasps of the correct model."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from attrs import field, frozen
from attrs.validators import ge

from graspsense.core.components.strict import structured
from graspsense.core.values.errors import ConfigError
from graspsense.experiments.recognise import TEST_SEED_OFFSET, classifiers_of, true_and_predicted
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult
from graspsense.experiments.trade.costs import CostSettings, simulated_result, simulated_trials

PROTOCOL: Final = "learned_on_another_model"


@frozen(kw_only=True)
class ModelErrorSettings(CostSettings):
    """The keys of `[judge]`."""

    error: float = field(default=0.0, validator=ge(-0.9))
    """Relative error of the gripper settings named in `wrong`, in the model for training."""
    wrong: tuple[str, ...] = field(
        default=(
            "coulomb_n",
            "breakaway_n",
            "load_friction_coefficient",
            "rotor_kg_m2",
            "pad_stiffness_n_m",
        ),
        alias="of",
    )
    learned_on: Mapping[str, Any] = field(factory=dict)
    """Further gripper settings of the model for training, such as `accuracy`."""


def physics(params: Mapping[str, Any], seed: int) -> RecognitionResult:
    """Return the rates on the correct model of classifiers trained on the wrong one. Raises ConfigError."""
    settings = structured(params["judge"], ModelErrorSettings, "[judge]")
    training = simulated_trials({**params, "settings": _wrong_model(params, settings)}, seed)
    test = simulated_trials(params, seed + TEST_SEED_OFFSET)
    cost = float(settings.learned_on.get("accuracy", settings.error))
    results = []
    for name, learner in classifiers_of(params).items():
        for target in settings.targets:
            true, predicted = true_and_predicted(learner, training, test, target, seed)
            results.append(
                ClassifierResult.from_answers(name, target, PROTOCOL, true, predicted, test, cost=cost)
            )
    return simulated_result(test, results)


def _wrong_model(params: Mapping[str, Any], settings: ModelErrorSettings) -> dict[str, dict[str, Any]]:
    """Return the settings of the model for training."""
    wrong = {table: dict(keys) for table, keys in params["settings"].items()}
    for key in settings.wrong:
        try:
            wrong["gripper"][key] *= 1.0 + settings.error
        except (KeyError, TypeError):
            raise ConfigError(
                f"judge.of: {key!r} is not a number among the settings of the gripper"
            ) from None
    wrong["gripper"].update(settings.learned_on)
    return wrong
