"""Which faults follow from which, so that a person is told the cause and not what follows from it.

A pad that stands still also differs from the other one, and still feels a force when the fingers have opened. Each of
these is a fault of its own where nothing explains it. A fault is left out only beside one that implies it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Final

ALONE: Final = ("other finger alone", "pads disagree", "pads feel nothing in the hold", "stalled")
"""What follows from a pad that feels too little or too much while the fingers press."""
PAD: Final[Mapping[str, tuple[str, ...]]] = {
    "fingertip without signal": ("fingertip stuck", "pad absent"),
    "fingertip stuck": ("fingertip with frozen cells", "pad stuck"),
    "pad stuck": ("pad stands still",),
    "pad stands still": ("fingertip with frozen cells", "pad jumps", "pad off its zero"),
    "fingertip with frozen cells": ALONE,
    "pad absent": ALONE,
    "pad noisy": ("pad drifts", "pad jumps", "pad off its zero"),
    "pad drifts": ("pad jumps", "pad off its zero", "contact in free air"),
    "pad off its zero": ("pad jumps",),
    "pad below zero": ("pad jumps", "pad off its zero"),
    "pad jumps": ("pad feels more on opening", *ALONE),
    "pad feels more on opening": ("pads disagree",),
}
"""What follows of the same pad, and of the grasp, from a fault of a pad."""
ENCODER: Final = (
    "gap against the command",
    "gap and velocity disagree",
    "gap late",
    "gap not as before",
    "fingers did not open",
    "fingers stand still",
    "frames repeated",
    "not the commanded speed",
    "stalled",
)
"""What follows from a gap that is wrong."""
MOTOR: Final = ("motor off", "stalled", "fingers stand still", "not the commanded speed")
"""What follows from a motor that does not do what it is told."""
GRASP: Final[Mapping[str, tuple[str, ...]]] = {
    "clock stands still": ("clock jumps", "clock slow"),
    "clock jumps": (
        "cell images stopped",
        "clock slow",
        "frames lost",
        "gap jumps",
        "moves too easily",
        *ENCODER,
    ),
    "clock slow": ("gap and velocity disagree", "not the commanded speed"),
    "frames lost": ("gap late",),
    "gap jumps": ("effort not as before", *ENCODER),
    "gap and velocity disagree": ("gap late", "gap not as before", "not the commanded speed", "stalled"),
    "fingers did not open": ("gap late", "gap not as before"),
    "effort stuck": (
        "effort has the wrong sign",
        "motor off",
        "motor reversed",
        "motor too strong",
        "motor too weak",
    ),
    "motor reversed": ("motor too strong", "motor too weak", "gap late", *MOTOR),
    "motor too strong": ("fingers rush", "moves too easily", "stronger than commanded", *MOTOR),
    "moves too easily": ("stronger than commanded",),
    "motor too weak": ("gap late", "fingers did not open", "left finger alone", "right finger alone", *MOTOR),
}
"""What follows from a fault that is not of one pad."""
OTHER: Final = {"left": "right", "right": "left"}


def following(name: str) -> Iterable[str]:
    """Return the names of the faults that follow from this one at once; those of both pads have their side.

    A fault of a pad that is not listed is one that the gripper itself tells: all that the pad shows follows from it.
    """
    side, _, what = name.partition(" ")
    if side not in OTHER or what == "finger alone":
        return GRASP.get(name, ())
    names = PAD.get(what, tuple(PAD)) if what != "edge noisy" else ()
    return [f"{side} {then}" if then in PAD else then.replace("other", OTHER[side]) for then in names]


def causes(names: Iterable[str]) -> list[str]:
    """Return these faults without those that follow from others of them, in their order.

    >>> causes(["left pad stands still", "pads disagree", "right pad noisy", "left pad off its zero"])
    ['left pad stands still', 'right pad noisy']
    """
    names = list(names)
    return [name for name in names if not any(follows(name, other) for other in names)]


def follows(name: str, cause: str) -> bool:
    """Return whether a fault follows from another one, at once or by way of others."""
    reached: set[str] = set()
    new = {cause}
    while new:
        reached |= new
        new = set(chain.from_iterable(map(following, new))) - reached
    return name != cause and name in reached
