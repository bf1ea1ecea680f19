"""The words of a page for protocols, controls and targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from graspsense.core.values.errors import counted

CONTROLS: Final[Mapping[str, tuple[str, str]]] = {
    "majority_class": ("most frequent label", "always the same answer, without any measurement"),
    "shuffled_labels": (
        "shuffled labels",
        "the same trials with wrong labels: a rate above guessing means that the evaluation itself is wrong",
    ),
    "before_contact": (
        "before contact",
        "what the recording reveals before contact: a rate above guessing means that it reveals the labels",
    ),
    "first_line": (
        "first line",
        "what the first frame of an imported recording reveals: a rate above guessing means that it reveals the labels",
    ),
    "width_only": ("width alone", "what the first contact shows, without any squeeze"),
    "instance_held_out": ("new objects", "no grasp of the same object was used for training"),
    "group_held_out": (
        "trials that belong together",
        "neither near copies nor neighbours that are alike were used for training, but perhaps the same objects",
    ),
    "recording_order": (
        "order of recording",
        "training and test trials come from different times of the recording",
    ),
}
"""Name of a control in `evaluate` to its title on a page, and its purpose."""

TARGETS: Final[Mapping[str, str]] = {
    "both": "the object and its state",
    "class": "the object",
    "state": "the state of a known object",
}
"""Target to what is recognised, in words."""


def about_grasps(features: Sequence[str], target: str, answers: int, guess: float | None) -> str:
    """Return what a grasp measures and a classifier learns, and the rate of guessing, where it was measured."""
    text = (
        "A gripper closes two fingers with force sensors on an object that it cannot see into. Each grasp gives a few "
        f"numbers ({', '.join(features)}), from which a classifier learns {TARGETS[target]}. There are "
        f"{counted(answers, 'possible answer')}."
    )
    if guess is None:
        return text
    return f"{text} Always guessing the most frequent label is right in {100 * guess:.0f} %."


def control_words(name: str, what: str) -> tuple[str, str]:
    """Return the title of a control on a page, and its purpose; `what` is used for a control without an entry."""
    if name.startswith("stratified_"):
        return f"{name.split('_')[1]} stratified folds", "the same objects may occur in training and test"
    return CONTROLS.get(name, (name.replace("_", " "), what))


def protocol_words(protocol: str) -> str:
    """Return how trials were split into training and test, as the end of a sentence."""
    if protocol == "instance_held_out":
        return "a classifier that was trained neither on it nor on any other grasp of the same object"
    if protocol == "group_held_out":
        return (
            "a classifier that was trained neither on it nor on trials that belong to it by their values, but perhaps "
            "on other grasps of the same object"
        )
    if protocol.startswith("stratified"):
        folds = protocol.split("_")[1]
        return (
            f"a classifier that was not trained on it ({folds} folds, stratified by label), but perhaps on other "
            "grasps of the same object"
        )
    return "a classifier that was trained on other trials"
