"""The results of an evaluation, with types from the measurement up to the page that shows them; confusion matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from attrs import field, frozen

from graspsense.core.learn.labelled import Target, recognised
from graspsense.core.values.display import html
from graspsense.core.values.label_text import natural_order
from graspsense.core.values.printable import in_one_line
from graspsense.evaluation.doubt import Reliability, SetCoverage
from graspsense.evaluation.intervals import Difference, RecognitionRate


@frozen
class Confusion:
    """Counts of trials: rows are true labels, columns predicted labels."""

    labels: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]

    @property
    def correct(self) -> int:
        """The number of correct predictions."""
        return sum(self.counts[i][i] for i in range(len(self.labels)))

    @property
    def n(self) -> int:
        """The number of trials."""
        return sum(map(sum, self.counts))


def confusion(true: Sequence[str], predicted: Sequence[str]) -> Confusion:
    """Return the confusion matrix over all labels that occur on either side, in natural order."""
    labels = tuple(natural_order([*true, *predicted]))
    numbers = {label: i for i, label in enumerate(labels)}
    counts = [[0] * len(labels) for _ in labels]
    for actual, answer in zip(true, predicted, strict=True):
        counts[numbers[actual]][numbers[answer]] += 1
    return Confusion(labels, tuple(map(tuple, counts)))


@frozen
class Measurement:
    """A rate under one protocol or control, or the reason why it could not be measured.

    `what` defines it. A control with other features is measured on the trials that have any of them: `rate.n` is their
    number, and its `difference` is on the same trials. `difference` is the rate of the protocol named in
    `difference_of`, minus this rate. `permutation_p` is the p-value of the headline among shuffled labels, None for all
    other controls.
    """

    what: str
    rate: RecognitionRate | None = None
    reason: str = ""
    difference: Difference | None = None
    difference_of: str = ""
    permutation_p: float | None = None


@frozen
class CurvePoint:
    """One point of the learning curve: the mean number of training trials, and the rate."""

    trained_on: float
    rate: RecognitionRate


@frozen(kw_only=True)
class Evaluation:
    """The result of `graspsense evaluate`; its JSON form is what `--json` prints."""

    source: str
    classifier: str
    settings: Mapping[str, Any] = field(factory=dict)
    target: Target
    features: tuple[tuple[str, str], ...]
    """Name and unit of each feature."""
    folds: int
    seed: int
    protocol: str
    """The protocol of `headline`."""
    headline: RecognitionRate
    confusion: Confusion
    """The confusion matrix of `headline`."""
    protocols: Mapping[str, Measurement]
    controls: Mapping[str, Measurement]
    by_class: Mapping[str, RecognitionRate]
    """The rate of the headline among the trials of each class (`class` of `class:state`)."""
    unknown: RecognitionRate
    """Held-out trials that the model of their fold calls unknown, or that have no feature at all.

    Every trial has a known label, so this is the rate of false alarms. In all rates they count by their predicted
    label.
    """
    learning_curve: tuple[CurvePoint, ...]
    warnings: tuple[str, ...]
    """Findings of the controls that cast doubt on the headline."""
    notes: tuple[str, ...]
    by_features: Mapping[str, RecognitionRate] = field(factory=dict)
    """The rate of the headline among trials with features and without any; empty if all trials have features."""
    confusions: Mapping[str, Confusion] = field(factory=dict)
    """The confusion matrix of each protocol that was measured."""
    sets: SetCoverage | None = None
    """The coverage of the prediction sets, on the trials and folds of the headline."""
    reliability: Reliability | None = None
    """How well the probabilities of the headline agree with the rate."""

    @property
    def recognised(self) -> Target:
        """What a correct prediction recognises: the target, or the class if the labels have no state."""
        return recognised(self.target, self.confusion.labels)

    def __repr__(self) -> str:
        return in_one_line(f"<Evaluation: {self.words}>")

    def _repr_html_(self) -> str:
        return html(self)

    @property
    def words(self) -> str:
        """The classifier, the source, the rate and the protocol, in one line."""
        return f"{self.classifier} on {self.source}: {self.headline.words}, {self.protocol}"
