"""The results of tasks, with types. Files and worker processes hold their JSON form (`evaluation.json_codec`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

from attrs import field, frozen

from graspsense.core.learn.labelled import Labelled, Target
from graspsense.core.values.reasons import TreeNode
from graspsense.evaluation.intervals import RecognitionRate, rate_among, rate_of
from graspsense.evaluation.results import Confusion, Measurement, confusion
from graspsense.report.grasp_curve import GraspCurve

MOST_KEPT_GRASPS: Final = 1000
"""Limit on the grasps of each label whose curves are kept with a result."""


@frozen(kw_only=True)
class ClassifierResult:
    """The rate of one classifier for one target, with its confusion matrix.

    `cost` is what the rate costs in a trade-off experiment.
    """

    classifier: str
    target: Target
    protocol: str
    rate: RecognitionRate
    confusion: Confusion
    controls: Mapping[str, Measurement] = field(factory=dict)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    tree: tuple[TreeNode, ...] | None = None
    """The tree that the classifier grows on all trials; None if it grows none, or was not asked to."""
    cost: float | None = None

    @classmethod
    def from_answers(
        cls,
        classifier: str,
        target: Target,
        protocol: str,
        true: Sequence[str],
        predicted: Sequence[str],
        trials: Labelled | None = None,
        folds: int = 0,
        **more: Any,
    ) -> ClassifierResult:
        """Return the result of these predictions; `more` are further fields.

        If the answers are those of `trials`, in their order, the interval takes their instances into account, and with
        `folds`, that so many folds share their training trials.
        """
        matrix = confusion(true, predicted)
        right = [answer == label for answer, label in zip(predicted, true, strict=True)]
        return cls(
            classifier=classifier,
            target=target,
            protocol=protocol,
            rate=rate_of(right, folds=folds) if trials is None else rate_among(trials, right, folds=folds),
            confusion=matrix,
            **more,
        )


@frozen(kw_only=True)
class TrialValues:
    """The labels and features of the trials of a task; None for a missing value."""

    features: tuple[tuple[str, str], ...]
    """Name and unit of each feature."""
    labels: tuple[str, ...]
    instances: tuple[str, ...] | None
    values: tuple[tuple[float | None, ...], ...]

    @classmethod
    def from_trials(cls, labelled: Labelled) -> TrialValues:
        """Return the labels and features of these trials."""
        table = labelled.table
        return cls(
            features=tuple(zip(table.names, table.units, strict=True)),
            labels=labelled.labels,
            instances=labelled.instances,
            values=tuple(
                tuple(None if math.isnan(value) else value for value in row) for row in table.values.tolist()
            ),
        )

    def column(self, name: str) -> tuple[float | None, ...]:
        """Return the values of a feature. Raises ValueError if there is no such feature."""
        k = [feature for feature, _ in self.features].index(name)
        return tuple(row[k] for row in self.values)

    def by_label(self, name: str) -> dict[str, list[float]]:
        """Return the values of a feature for each label, without missing values."""
        values: dict[str, list[float]] = {}
        for label, value in zip(self.labels, self.column(name), strict=True):
            if value is not None:
                values.setdefault(label, []).append(value)
        return values


@frozen(kw_only=True)
class RecognitionResult:
    """The result of a task that measures recognition rates."""

    source: str
    simulated: bool
    notes: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(factory=dict)
    trials: TrialValues | None = None
    classifiers: tuple[ClassifierResult, ...] = ()
    grasps: tuple[GraspCurve, ...] = ()
    """Some grasps of the first seed."""


class AnyTaskResult(Protocol):
    """What the results of all kinds of tasks have."""

    @property
    def source(self) -> str:
        """Where the trials are from, in words."""

    @property
    def simulated(self) -> bool:
        """Whether they are simulated."""
