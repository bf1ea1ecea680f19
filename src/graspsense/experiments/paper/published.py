"""What the paper prints, from the file beside this one."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any, Literal

from attrs import field, frozen

from graspsense.core.strict import structured
from graspsense.evaluation.confusion import Confusion
from graspsense.evaluation.intervals import wilson

Sort = Literal["fitted", "predicted"]


@frozen(kw_only=True)
class PublishedRate:
    """A rate that the paper prints, and where ours comes from."""

    id: str
    where: str
    what: str
    printed: float
    sort: Sort
    experiment: str
    target: str
    at: Mapping[str, Any] = field(factory=dict)
    """What the case of the experiment differs in."""
    class_: str = ""
    correct: int | None = None
    n: int | None = None
    note: str = ""

    @property
    def rate(self) -> float:
        """The rate: that of the counts where there are any, else the printed one."""
        return self.printed if self.correct is None or self.n is None else self.correct / self.n

    @property
    def interval(self) -> tuple[float, float] | None:
        """Its 95 % Wilson interval, where the counts are known."""
        return None if self.correct is None or self.n is None else wilson(self.correct, self.n)


@frozen(kw_only=True)
class PublishedMatrix:
    """A confusion matrix that the paper prints, as it is printed."""

    id: str
    where: str
    labels: tuple[str, ...]
    answered_by_true: tuple[tuple[int, ...], ...]
    true_class_is: Literal["row", "column"]
    note: str = ""

    @property
    def confusion(self) -> Confusion:
        """The matrix with the truth in rows."""
        printed = self.answered_by_true
        counts = printed if self.true_class_is == "row" else tuple(zip(*printed, strict=True))
        return Confusion(self.labels, tuple(tuple(row) for row in counts))


@frozen(kw_only=True)
class Lines:
    """Sentences, and what they are of."""

    lines: tuple[str, ...]
    note: str = ""


@frozen(kw_only=True)
class Published:
    """Everything that is held against what comes out here."""

    rates: tuple[PublishedRate, ...]
    matrices: tuple[PublishedMatrix, ...]
    authors_tree: Lines
    inconsistencies: Lines
    fitted: Fitted

    def matrix(self, id_: str) -> PublishedMatrix:
        """Return a matrix by its id."""
        return next(one for one in self.matrices if one.id == id_)


@frozen(kw_only=True)
class Fitted:
    """What of the model was fitted to the paper, and how many numbers these are."""

    parameters: tuple[str, ...]
    count: int
    rests: str


@cache
def published() -> Published:
    """Return what the paper prints."""
    values: dict[str, Any] = tomllib.loads(
        files("graspsense.experiments.paper").joinpath("published.toml").read_text(encoding="utf-8")
    )
    for one in values["rates"]:
        if "class" in one:
            one["class_"] = one.pop("class")
    found: Published = structured(values, Published, "published.toml")
    return found
