"""Which label was taken for which."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import frozen


@frozen
class Confusion:
    """Counts of trials; a row is the true label, a column the predicted one."""

    labels: tuple[str, ...]
    counts: tuple[tuple[int, ...], ...]

    @property
    def correct(self) -> int:
        """The sum of the diagonal."""
        return sum(self.counts[i][i] for i in range(len(self.labels)))

    @property
    def n(self) -> int:
        """The number of trials."""
        return sum(map(sum, self.counts))


def confusion(true: Sequence[str], predicted: Sequence[str]) -> Confusion:
    """Return the counts over every label that occurs on either side, sorted."""
    labels = tuple(sorted({*true, *predicted}))
    numbers = {label: i for i, label in enumerate(labels)}
    counts = [[0] * len(labels) for _ in labels]
    for one, other in zip(true, predicted, strict=True):
        counts[numbers[one]][numbers[other]] += 1
    return Confusion(labels, tuple(map(tuple, counts)))
