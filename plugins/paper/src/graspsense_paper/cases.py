"""Selecting the cases of an experiment that a comparison with the paper is about."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final, Literal

from attrs import evolve

from graspsense.experiment_api import ConditionResult, ExperimentCase, Summary

Protocol = Literal["all", "one"]
PROTOCOLS: Final[Mapping[Protocol, str]] = {"all": "all states", "one": "one state"}
"""Each bottle is used in all states, or in one; section III.E does not say which. The values are words for a table."""
SWEPT: Final = "data.states_per_instance"


def of_protocol(summary: Summary, protocol: Protocol) -> Summary:
    """Return the part of a summary with this protocol; cases that do not vary it are in both."""
    cases = tuple(case for case in summary.planned.cases if case.levels.get(SWEPT, protocol) == protocol)
    kept = {case.name for case in cases}
    return evolve(
        summary,
        planned=evolve(summary.planned, cases=cases),
        conditions=tuple(condition for condition in summary.conditions if condition.case.name in kept),
    )


def by_protocol(
    summary: Summary, experiment: str, target: str, settings: Mapping[str, Any] | None = None
) -> dict[Protocol, ConditionResult]:
    """Return the condition of a case under each protocol that there are results for."""
    return {
        protocol: condition
        for protocol in PROTOCOLS
        if (condition := condition_result(of_protocol(summary, protocol), experiment, target, settings))
    }


def condition_result(
    summary: Summary,
    experiment: str,
    target: str,
    settings: Mapping[str, Any] | None = None,
    classifier: str = "c45",
) -> ConditionResult | None:
    """Return the condition of a case of an experiment, which may be part of another experiment; None if there is none.

    `settings` holds the swept values of the case, as `ExperimentCase.levels`.
    """
    for condition in summary.conditions:
        if (
            is_of(condition.case, summary, experiment, settings)
            and condition.classifier == classifier
            and condition.target == target
        ):
            return condition
    return None


def is_of(
    case: ExperimentCase, summary: Summary, experiment: str, settings: Mapping[str, Any] | None = None
) -> bool:
    """Return whether a case belongs to this experiment and has these swept values."""
    wanted = settings or {}
    return (case.part or summary.planned.name) == experiment and all(
        case.levels.get(key) == value for key, value in wanted.items()
    )
