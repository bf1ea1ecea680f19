"""The task `trade`: like `recognise`, with the cost of each case; and what all trade-off tasks share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Literal

from attrs import asdict, evolve, field, frozen

from graspsense.core.components.strict import structured
from graspsense.core.learn.labelled import Labelled, Target, class_of
from graspsense.core.settings.resolved import settings_from
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.trace import Trace
from graspsense.experiments.recognise import EvaluationSettings, recognise
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult, TrialValues
from graspsense.sources.simulated import simulated
from graspsense.sources.trial_source import TrialSource, groups_of

FOLDS: Final = 10


@frozen(kw_only=True, slots=False)
class Cost:
    """The cost that rates are plotted against."""

    cost: str = "seconds"
    """A key of the settings, such as `controller.probing_force_n`, or `seconds`: the duration of a grasp."""
    cheap: Literal["low", "high"] = "low"
    """Whether low or high values are cheap."""
    axis: str = "seconds of a grasp"
    """The title of the axis."""
    caution: str = ""
    """A reservation that is stated with every recommendation."""


@frozen(kw_only=True)
class TradeSettings(EvaluationSettings, Cost):
    """The keys of `[judge]`: those of `recognise`, and the cost."""


@frozen(kw_only=True)
class CostSettings(Cost):
    """The keys of `[judge]` of tasks with an evaluation of their own."""

    targets: tuple[Literal["both", "class", "state"], ...] = field(default=("state",))


def trade(params: Mapping[str, Any], seed: int) -> RecognitionResult:
    """Return the result of `recognise`, with the cost of each rate.

    Raises ConfigError if the cost is not a number among the settings.
    """
    settings = structured(params["judge"], TradeSettings, "[judge]")
    own = asdict(settings)
    for key in asdict(Cost()):
        del own[key]
    result = recognise({**params, "judge": own}, seed)
    if settings.cost == "seconds":
        assert result.trials is not None
        cost = mean_seconds(params["settings"], result.trials)
    else:
        cost = _setting(params, settings.cost)
    return evolve(
        result, classifiers=tuple(evolve(classifier, cost=cost) for classifier in result.classifiers)
    )


def _setting(params: Mapping[str, Any], key: str) -> float:
    table, _, name = key.partition(".")
    try:
        return float(params["settings"][table][name])
    except (KeyError, TypeError, ValueError):
        raise ConfigError(
            f"judge.cost = {key!r} is not a number among the settings of this experiment"
        ) from None


def mean_seconds(settings: Mapping[str, Any], trials: TrialValues) -> float:
    """Return the mean duration of a grasp: closing to the contact at the closing speed, then until rest is shown.

    Rest is shown when the gap has not changed for the rest window. Raises ConfigError if no grasp came to rest.
    """
    window_s = float(settings["controller"]["rest_window_s"])
    open_m = float(settings["gripper"]["open_gap_m"])
    speed_m_s = float(settings["controller"]["closing_speed_m_s"])
    pairs = zip(trials.column("p_first"), trials.column("delta_t"), strict=True)
    durations = [(open_m - p) / speed_m_s + t + window_s for p, t in pairs if p is not None and t is not None]
    if not durations:
        raise ConfigError("no grasp came to rest, so there is no duration")
    return sum(durations) / len(durations)


def simulated_trials(
    params: Mapping[str, Any], seed: int, on_trace: Callable[[int, str, Trace], None] | None = None
) -> Labelled:
    """Return the simulated trials of a task."""
    settings = settings_from(params["settings"], "the settings of the task")
    groups = groups_of(structured(params["data"], TrialSource, "[data]"))
    return simulated(settings, groups=groups, seed=seed, on_trace=on_trace)


def target_labels(labels: Sequence[str], target: Target) -> list[str]:
    """Return the labels to recognise: whole labels, or classes. States stay whole: folds separate the classes."""
    return [class_of(label) for label in labels] if target == "class" else list(labels)


def simulated_result(data: Labelled, classifiers: Sequence[ClassifierResult]) -> RecognitionResult:
    """Return the result of a task on simulated trials."""
    return RecognitionResult(
        source=data.source, simulated=True, notes=data.notes, classifiers=tuple(classifiers)
    )
