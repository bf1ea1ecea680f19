"""The published figures of the paper, from `published.toml`."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from attrs import field, frozen

from graspsense.experiment_api import Confusion, structured, wilson


@frozen(kw_only=True)
class PublishedRate:
    """A rate that the paper prints, and the condition of ours that it is compared with."""

    id: str
    where: str
    what: str
    printed: float
    about: tuple[str, ...]
    """The results that it shares trials with; see `basis`."""
    experiment: str
    target: str
    settings: Mapping[str, Any] = field(factory=dict)
    """The swept values that select the case of the experiment."""
    of_class: str = ""
    correct: int | None = None
    n: int | None = None
    repeats: str = ""
    """The id of another published rate that is compared with the same figure of ours; this one is not counted again."""
    note: str = ""

    @property
    def rate(self) -> float:
        """The rate from the counts if they are known, otherwise the printed rate."""
        return self.printed if self.correct is None or self.n is None else self.correct / self.n

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % Wilson interval if the counts are known."""
        return None if self.correct is None or self.n is None else wilson(self.correct, self.n)


@frozen(kw_only=True)
class PublishedMatrix:
    """A confusion matrix as the paper prints it."""

    id: str
    where: str
    labels: tuple[str, ...]
    answered_by_true: tuple[tuple[int, ...], ...]
    true_class_is: Literal["row", "column", "not stated"]
    note: str = ""

    @property
    def confusion(self) -> Confusion:
        """The matrix with true labels in rows; as printed where these are not stated."""
        printed = self.answered_by_true
        counts = printed if self.true_class_is != "column" else tuple(zip(*printed, strict=True))
        return Confusion(self.labels, tuple(tuple(row) for row in counts))


@frozen(kw_only=True)
class Lines:
    """Lines of text with a note."""

    lines: tuple[str, ...]
    note: str = ""


@frozen(kw_only=True)
class Published:
    """All figures of the paper that are compared with ours."""

    rates: tuple[PublishedRate, ...]
    matrices: tuple[PublishedMatrix, ...]
    authors_tree: Lines
    inconsistencies: Lines
    fitted: FittedParameters
    left_out: Lines
    """What is in the paper and not compared."""

    def matrix(self, id_: str) -> PublishedMatrix:
        """Return a matrix by its id."""
        return next(matrix for matrix in self.matrices if matrix.id == id_)


@frozen(kw_only=True)
class FittedParameters:
    """The parameters of the model that were fitted to the paper, and their number."""

    parameters: tuple[str, ...]
    count: int
    rests: str


@cache
def published() -> Published:
    """Return the figures of the paper."""
    values: dict[str, Any] = tomllib.loads(
        files("graspsense_paper").joinpath("published.toml").read_text(encoding="utf-8")
    )
    content: Published = structured(values, Published, "published.toml")
    return content
