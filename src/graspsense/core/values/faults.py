"""What can go wrong with a gripper while it grasps, each with a name, a limit, and words for a person."""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import Final

from attrs import field, frozen
from attrs.validators import ge, gt, instance_of

from graspsense.core.values.signals import Outcome

LIMITED: Final = "squeeze limited"
"""The name of the warning of a squeeze that is not the one that the controller commanded."""


def faults_among(warnings: Iterable[str]) -> list[str]:
    """Return the warnings of a grasp that are faults, so not that its squeeze was limited."""
    return [warning for warning in warnings if not warning.startswith(LIMITED)]


@frozen(kw_only=True)
class StatusBit:
    """A bit of `Frame.status` that a gripper sets.

    `mask` is the bit as a number (`1 << 4`). `name` names it in a few words ("encoder fault"), and `meaning` says what
    follows for the grasp. The first frame with the bit gives a warning. A bit that is set for longer than `limit_s` (s,
    in sum over approach, squeeze and hold) ends the grasp as aborted, and the fingers open; `inf` never does. A bit
    with a finite limit that is set before the fingers close refuses the grasp.
    """

    mask: int = field(validator=[instance_of(int), gt(0)])
    name: str
    meaning: str
    limit_s: float = field(default=inf, converter=float, validator=ge(0.0))


@frozen
class Fault:
    """A fault that was seen in a grasp.

    `name` is the same for the same fault ("left pad stuck"), and `words` say what was seen and what to do. A fault that
    `ends` the grasp ends it with `outcome`, and the fingers open; with `relaxes` they are only relaxed, because the
    motor cannot be trusted to open them.
    """

    name: str
    words: str
    ends: bool = False
    outcome: Outcome = Outcome.ABORTED
    relaxes: bool = False

    @property
    def told(self) -> str:
        """The name with the words: `left pad stuck: its cells stand still`."""
        return f"{self.name}: {self.words}"
