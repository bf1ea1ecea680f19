"""The options of a tree, J48's names made plain, and the two presets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

Criterion = Literal["gain_ratio", "info_gain"]
Pruning = Literal["pessimistic", "reduced_error", "none"]
Engine = Literal["auto", "numpy", "fast"]


@dataclass(frozen=True, slots=True)
class Options:
    """How a tree is grown and pruned; the defaults are J48's.

    criterion: ``gain_ratio`` (C4.5: largest ratio among the attributes of at least average gain) or ``info_gain``.
    pruning: ``pessimistic`` (error estimates), ``reduced_error`` (errors on held-out rows; J48 -R) or ``none`` (-U).
    confidence_factor: of the pessimistic estimate, in (0, 1); smaller prunes more (-C).
    min_objects: least weight of at least two branches (-M).
    collapse: cut subtrees that do not lower the training error; not with ``reduced_error`` (off: -O).
    subtree_raising: let the heaviest branch take its parent's place in pessimistic pruning (off: -S).
    mdl_correction: charge a numeric split for the choice of its threshold (off: -J).
    actual_split_value: a threshold is a value that occurs in the data given to fit, not a midpoint
        (off: -doNotMakeSplitPointActualValue).
    laplace: smooth the distributions at the leaves (-A).
    binary_splits: one value against the rest for nominal attributes (-B).
    rep_folds: ``reduced_error`` holds out the last of so many stratified folds (-N).
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

    def __post_init__(self) -> None:
        """Raise ValueError on the first option outside its range."""
        _one_of("criterion", self.criterion, get_args(Criterion))
        _one_of("pruning", self.pruning, get_args(Pruning))
        _in_range(
            "confidence_factor", self.confidence_factor, 0.0 < self.confidence_factor < 1.0, "in (0, 1)"
        )
        _in_range("min_objects", self.min_objects, self.min_objects >= 1, "at least 1")
        _in_range("rep_folds", self.rep_folds, self.rep_folds >= 2, "at least 2")


def _one_of(name: str, value: object, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise ValueError(f"{name} is {value!r}; allowed: {', '.join(allowed)}")


def _in_range(name: str, value: object, holds: bool, allowed: str) -> None:
    if not holds:
        raise ValueError(f"{name} is {value!r}; it must be {allowed}")


J48 = Options()
"""J48's defaults: gain ratio, pessimistic pruning, subtree raising."""

PAPER = Options(criterion="info_gain", pruning="reduced_error", mdl_correction=False)
"""The text of Chitta et al. (2010), section II.D: highest information gain, pruned against a held-out set."""
