"""Confusion matrices."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import frozen


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
    """Return the confusion matrix over all labels that occur on either side, sorted."""
    labels = tuple(sorted({*true, *predicted}))
    numbers = {label: i for i, label in enumerate(labels)}
    counts = [[0] * len(labels) for _ in labels]
    for actual, answer in zip(true, predicted, strict=True):
        counts[numbers[actual]][numbers[answer]] += 1
    return Confusion(labels, tuple(map(tuple, counts)))
