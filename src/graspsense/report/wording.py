"""The words for how rates were measured, and for the controls that stand beside them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

CONTROLS: Final[Mapping[str, tuple[str, str]]] = {
    "majority_class": ("always the commonest answer", "guessing, without feeling anything"),
    "shuffled_labels": (
        "names shuffled",
        "the same trials with wrong names: must be no better than guessing, or the measurement itself is wrong",
    ),
    "before_contact": (
        "before any touch",
        "what the recording gives away before contact: must be no better than guessing",
    ),
    "width_only": ("width alone", "what the first contact tells, without any squeeze"),
    "instance_held_out": ("things never felt before", "no grasp of the very thing was learned from"),
    "stratified_10_fold": (
        "ten stratified folds",
        "the same things may be learned from and judged on, as in the paper",
    ),
    "recording_order": (
        "in the order of recording",
        "learned from other times of the recording than judged on",
    ),
}
"""Control, by its name in `evaluate`, to what it is called on a page and what it is good for."""

TARGETS: Final[Mapping[str, str]] = {
    "both": "what the thing is and in what state",
    "class": "what the thing is",
    "state": "the state of a thing that is known",
}


def control_words(name: str, what: str) -> tuple[str, str]:
    """Return what a control is called on a page, and what it is good for."""
    return CONTROLS.get(name, (name.replace("_", " "), what))


def protocol_words(protocol: str) -> str:
    """Return how trials were dealt to learning and judging, as the end of a sentence."""
    if protocol == "instance_held_out":
        return "a classifier that has learned neither from it nor from any other grasp of the very same thing"
    if protocol.startswith("stratified"):
        folds = protocol.split("_")[1]
        return (
            f"a classifier that has not learned from it ({folds} folds, stratified by label), though perhaps from "
            "other grasps of the same thing"
        )
    return "a classifier that has learned from other trials altogether"
