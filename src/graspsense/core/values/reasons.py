"""The reasons for a prediction, in one form for all classifiers.

A reason is a rule that the trial meets, a contribution of one feature or of several together, or a text without either.
Contributions of a prediction add up: to the probability of the label, or to the logarithm of its odds against another
label (*log-odds*). A decision tree, in which reasons can be looked up, has one form too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, Literal

from attrs import asdict, frozen

from graspsense.core.values.units import in_words

MOST_SHOWN: Final = 5
"""Number of contributions that a prediction lists; the others are one reason together."""

Scale = Literal["probability", "log-odds"]


@frozen
class FeatureValue:
    """A feature of a trial that a reason is about. `value` is None where it is missing."""

    name: str
    value: float | None
    unit: str = ""

    @property
    def words(self) -> str:
        """The feature with its value, such as `p_first = 57.9 mm`."""
        return (
            f"{self.name} is missing"
            if self.value is None
            else f"{self.name} = {in_words(self.value, self.unit)}"
        )


def feature_values(
    names: Sequence[str], units: Sequence[str], values: Sequence[float]
) -> tuple[FeatureValue, ...]:
    """Return the features of a trial with these values, NaN for a missing one."""
    known = (None if math.isnan(value) else value for value in values)
    return tuple(map(FeatureValue, names, known, units))


@frozen
class Contribution:
    """How much a reason speaks for a label.

    On the scale `probability` it is added to the probability of the label; on `log-odds` to the natural logarithm of
    the odds of the label against the label `against`.
    """

    value: float
    scale: Scale
    label: str
    against: str = ""

    @property
    def words(self) -> str:
        """The contribution in percentage points, or as a factor of the odds."""
        if self.scale == "probability":
            return f"{100 * self.value:+z.1f} points"
        factor = math.exp(min(abs(self.value), 700.0))
        return f"odds of {self.label} to {self.against} {'×' if self.value >= 0 else '÷'} {factor:.3g}"


@frozen(kw_only=True)
class Reason:
    """A reason for a prediction, in words and as values.

    `features` are the features that it is about. A rule is `above < value <= up_to`; a bound that it does not have is
    None. `contribution` is None for a rule or a text.
    """

    words: str
    features: tuple[FeatureValue, ...] = ()
    above: float | None = None
    up_to: float | None = None
    contribution: Contribution | None = None

    def __str__(self) -> str:
        return self.words

    def as_json(self) -> dict[str, Any]:
        """Return the reason as `--json` prints it: the words, and what else it has."""
        given, has_rule = self.contribution, self.above is not None or self.up_to is not None
        parts = {
            "features": [asdict(feature) for feature in self.features],
            "rule": {"above": self.above, "up_to": self.up_to} if has_rule else None,
            "contribution": given and asdict(given, filter=lambda _, value: value != ""),
        }
        return {"words": self.words, **{name: part for name, part in parts.items() if part}}


def missing_feature(name: str, unit: str, words: str) -> Reason:
    """Return the reason that says why a feature is missing, or what stands for it."""
    return Reason(words=f"{name} is missing{words}", features=(FeatureValue(name, None, unit),))


def contribution_reasons(
    parts: Sequence[tuple[tuple[FeatureValue, ...], float]],
    start: float,
    *,
    scale: Scale,
    label: str,
    against: str = "",
) -> tuple[Reason, ...]:
    """Return a reason for each of the largest contributions, one for the others together, and one for the start.

    `parts` are contributions of single features, or of several together. `start` is the probability or the log-odds
    before any feature is known. The contributions of all reasons add up to that of the prediction.
    """
    ranked = sorted((part for part in parts if part[1] != 0.0), key=lambda part: -abs(part[1]))
    shown, others = ranked[:MOST_SHOWN], ranked[MOST_SHOWN:]
    if len(others) == 1:
        shown, others = ranked, []

    def reason(text: str, features: tuple[FeatureValue, ...], value: float) -> Reason:
        given = Contribution(value, scale, label, against)
        return Reason(words=f"{text}: {given.words}", features=features, contribution=given)

    reasons = [
        reason(" and ".join(feature.words for feature in features), features, value)
        for features, value in shown
    ]
    if others:
        smaller = tuple(dict.fromkeys(feature for features, _ in others for feature in features))
        value = math.fsum(value for _, value in others)
        reasons.append(reason(f"{len(others)} smaller contributions together", smaller, value))
    base = Contribution(start, scale, label, against)
    words = f"{100 * start:.1f} % for {label}" if scale == "probability" else base.words
    reasons.append(Reason(words=f"before any feature: {words}", contribution=base))
    return tuple(reasons)


@frozen(kw_only=True)
class TreeNode:
    """A node: its label, the number of training trials that reach it, and the number of these with another label.

    `parent` is the index of the parent node, None for the root; `branch` is the condition under which the parent leads
    here, in words and units. A node without children is a leaf. Parents come before their children.
    """

    label: str
    trials: float
    wrong: float
    parent: int | None = None
    branch: str = ""
