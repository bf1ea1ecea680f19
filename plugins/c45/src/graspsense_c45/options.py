"""The options of a tree, and two presets."""

from __future__ import annotations

from typing import Literal, get_args

from attrs import frozen

Criterion = Literal["gain_ratio", "info_gain"]
Pruning = Literal["pessimistic", "reduced_error", "none"]
Engine = Literal["auto", "plain", "fast"]


@frozen
class Options:
    """How a tree is grown and pruned. The defaults are those of J48, whose options are in brackets.

    criterion: ``gain_ratio`` (C4.5: the largest ratio among the attributes of at least average gain) or ``info_gain``.
    pruning: ``pessimistic`` (estimated errors), ``reduced_error`` (errors on held-out rows; -R) or ``none`` (-U).
    confidence_factor: of the pessimistic estimate, in (0, 1); a smaller one prunes more (-C).
    min_objects: least weight of at least two branches, in rows (-M).
    collapse: whether subtrees that do not lower the training error become leaves; not with ``reduced_error`` (off: -O).
    subtree_raising: whether the heaviest branch may replace its parent in pessimistic pruning (off: -S).
    mdl_correction: whether the gain of a numeric test is reduced by the cost of its threshold (off: -J).
    actual_split_value: whether a threshold is a value that occurs in the data, instead of a midpoint
        (off: -doNotMakeSplitPointActualValue).
    laplace: whether probabilities are smoothed at the leaves (-A).
    binary_splits: whether nominal attributes are tested for one value against the others (-B).
    rep_folds: ``reduced_error`` holds out the last of this number of stratified folds (-N).

    Raises ValueError for an option outside its range.
    """

    criterion: Criterion = "gain_ratio"
    pruning: Pruning = "pessimistic"
    confidence_factor: float = 0.25
    min_objects: float = 2
    collapse: bool = True
    subtree_raising: bool = True
    mdl_correction: bool = True
    actual_split_value: bool = True
    laplace: bool = False
    binary_splits: bool = False
    rep_folds: int = 3

    def __attrs_post_init__(self) -> None:
        """Raise ValueError on the first option outside its range."""
        _check_choice("criterion", self.criterion, get_args(Criterion))
        _check_choice("pruning", self.pruning, get_args(Pruning))
        _check_range(
            "confidence_factor", self.confidence_factor, 0.0 < self.confidence_factor < 1.0, "in (0, 1)"
        )
        _check_range("min_objects", self.min_objects, self.min_objects >= 1, "at least 1")
        _check_range("rep_folds", self.rep_folds, self.rep_folds >= 2, "at least 2")


def _check_choice(name: str, value: object, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ValueError(f"{name} is {value!r}; allowed: {', '.join(allowed)}")


def _check_range(name: str, value: object, holds: bool, allowed: str) -> None:
    if not holds:
        raise ValueError(f"{name} is {value!r}; it must be {allowed}")


J48 = Options()
"""J48's defaults: gain ratio, pessimistic pruning, subtree raising."""

PAPER = Options(criterion="info_gain", pruning="reduced_error", mdl_correction=False)
"""As Chitta, Piccoli and Sturm (2010) describe it, section II.D: highest information gain, reduced-error pruning."""
