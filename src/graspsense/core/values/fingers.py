"""Fingers that bear force, and how the forces of any number of them become the two forces of a frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from math import nan, sqrt
from typing import Final, Literal

from attrs import field, frozen
from attrs.validators import in_

from graspsense.core.values.channel import Channel

PREFIX: Final = "force_"
TOUCH: Final = ("sides", "each", "any")
"""The rules by which fingers are taken to touch: see `FingerForce.touch`."""
Vector = tuple[float, float, float]


@frozen
class FingerForce(Channel):
    """The force on the pad of one finger of a hand, one number a tick, with where the finger presses.

    Its name is `force_` and the name of the finger: `FingerForce("force_thumb", "N", 100.0, side="left")`. The number
    is in `Reading.signals`, as of every further channel. `opposed_forces` gives the two forces of the frame from those
    of all fingers. Raises ValueError for another name, and for a direction that is none.
    """

    side: Literal["", "left", "right"] = field(default="", validator=in_(("", "left", "right")), kw_only=True)
    """The group that the finger belongs to, of two opposed ones: the thumb is `left`, the others `right`."""
    closing: Vector | tuple[()] = field(default=(), converter=tuple, kw_only=True)
    """The direction in which its pad moves on closing, as (x, y, z) in the frame of the tool; empty if not known."""
    touch: Literal["sides", "each", "any"] = field(default="sides", validator=in_(TOUCH), kw_only=True)
    """When both touch, the same for every finger of a hand.

    `sides`: the fingers of each side bear the contact force together. `each`: every finger does. `any`: two opposed
    fingers do."""

    def __attrs_post_init__(self) -> None:
        super().__attrs_post_init__()
        if not self.name.startswith(PREFIX) or self.name == PREFIX:
            raise ValueError(
                f"channel {self.name!r} is the force of a finger: name it {PREFIX}{self.name}, with the name of the "
                "finger behind the underscore"
            )
        if self.name in ("force_left", "force_right"):
            raise ValueError(
                f"channel {self.name!r} is a force of the frame: give the finger another name, as in force_thumb"
            )
        if self.closing and not (len(self.closing) == 3 and 0.0 < _length(self.closing) < 1e300):
            raise ValueError(f"{self.name}: closing = {self.closing!r} is not a direction: give (x, y, z)")

    @property
    def finger(self) -> str:
        """The name of the finger."""
        return self.name.removeprefix(PREFIX)


def fingers_of(channels: Iterable[Channel]) -> tuple[FingerForce, ...]:
    """Return the fingers among these channels."""
    return tuple(channel for channel in channels if isinstance(channel, FingerForce))


def opposed_forces(channels: Iterable[Channel]) -> Callable[[Sequence[float]], tuple[float, float]]:
    """Return the function that gives the left and the right force of a frame from the forces of the fingers.

    The fingers are those among `channels`, in that order; a backend calls it with its own `channels`.

    Both are at or above a force exactly where the fingers touch with it by their rule (`FingerForce.touch`):

    - `sides`: what each side bears together. Where `closing` is known, it is the part along the mean direction of the
      side, so that opposed sides balance at rest.
    - `each`: the least and the greatest force of a finger.
    - `any`: the forces of the two opposed fingers of which the lesser bears most. Fingers are opposed if they close
      towards each other (by more than a right angle), or are on different sides where no direction is known.

    Raises ValueError if these fingers cannot touch by their rule.

    >>> thumb, others = FingerForce("force_thumb", "N", side="left"), ("force_index", "force_middle")
    >>> fingers = (thumb, *(FingerForce(name, "N", side="right") for name in others))
    >>> opposed_forces(fingers)((4.0, 2.5, 1.5))
    (4.0, 4.0)
    """
    fingers = fingers_of(channels)
    rules = {finger.touch for finger in fingers}
    if len(fingers) < 2 or len(rules) != 1:
        raise ValueError(
            f"{len(fingers)} fingers with the rules {', '.join(sorted(rules)) or 'none'}: declare two or more fingers "
            "with one rule"
        )
    if rules == {"each"}:
        return _least_and_greatest
    if rules == {"any"}:
        pairs = [(i, k) for i, k in combinations(range(len(fingers)), 2) if _opposed(fingers[i], fingers[k])]
        if not pairs:
            raise ValueError("no two of these fingers are opposed: correct `closing` or `side`")
        return lambda forces: _strongest_pair(pairs, forces)
    left, right = _shares(fingers, "left"), _shares(fingers, "right")
    if len(left) + len(right) < len(fingers) or not left or not right:
        raise ValueError(
            "each finger is on one of two sides: declare side='left' or side='right' for every finger, and at least "
            "one finger for each, or another rule (touch='each' or touch='any')"
        )
    return lambda forces: (_borne(left, forces), _borne(right, forces))


def fingers_in_words(fingers: Sequence[FingerForce]) -> str:
    """Return which fingers the two forces of a frame are of, and with them every feature of the force."""
    if not fingers:
        return ""
    names = [finger.finger.replace("_", " ") for finger in fingers]
    if fingers[0].touch == "each":
        forces = f"the left force is the least of {', '.join(names)}, the right one the greatest"
        rule = "both touch when every finger does"
    elif fingers[0].touch == "any":
        forces = f"the two forces are of the two opposed fingers that bear most, of {', '.join(names)}"
        rule = "both touch when two opposed fingers do"
    else:
        sides = [
            " and ".join(name for finger, name in zip(fingers, names, strict=True) if finger.side == side)
            for side in ("left", "right")
        ]
        forces = f"the left force is of {sides[0]}, the right one of {sides[1]}"
        rule = "both touch when each side bears the contact force"
    return f"{len(fingers)} fingers: {forces}; {rule}; features of the force are of these two"


def _length(vector: Sequence[float]) -> float:
    return sqrt(sum(part * part for part in vector))


def _unit(vector: Sequence[float]) -> tuple[float, ...]:
    return tuple(part / _length(vector) for part in vector)


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _shares(fingers: Sequence[FingerForce], side: str) -> tuple[tuple[int, float], ...]:
    """Return the place of each finger of a side, and the share of its force along the direction of the side."""
    places = [k for k, finger in enumerate(fingers) if finger.side == side]
    if len(places) < 2 or not all(fingers[k].closing for k in places):
        return tuple((k, 1.0) for k in places)
    directions = [_unit(fingers[k].closing) for k in places]
    total = [sum(parts) for parts in zip(*directions, strict=True)]
    if _length(total) < 1e-6:
        raise ValueError(f"the fingers of the {side} side close against each other: put them on two sides")
    axis = _unit(total)
    return tuple((k, _dot(direction, axis)) for k, direction in zip(places, directions, strict=True))


def _borne(shares: Sequence[tuple[int, float]], forces: Sequence[float]) -> float:
    return sum([share * forces[k] for k, share in shares])


def _least_and_greatest(forces: Sequence[float]) -> tuple[float, float]:
    missing = any(force != force for force in forces)
    return (nan if missing else min(forces)), max((f for f in forces if f == f), default=nan)


def _opposed(a: FingerForce, b: FingerForce) -> bool:
    if a.closing and b.closing:
        return _dot(_unit(a.closing), _unit(b.closing)) < -1e-9
    return a.side != b.side or not a.side


def _strongest_pair(pairs: Sequence[tuple[int, int]], forces: Sequence[float]) -> tuple[float, float]:
    known = [(forces[i], forces[k]) for i, k in pairs if forces[i] == forces[i] and forces[k] == forces[k]]
    return max(known, key=lambda pair: (min(pair), max(pair)), default=(nan, nan))
