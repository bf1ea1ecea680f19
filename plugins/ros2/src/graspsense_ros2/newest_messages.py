"""The newest message of each topic that a gripper is measured by, and how old it is."""

from __future__ import annotations

import time
from collections.abc import Mapping
from math import inf
from typing import Any

import numpy as np
from attrs import define, field
from numpy.typing import NDArray

from graspsense.gripper_api import Clock, message_columns
from graspsense_ros2.message_types import BadMessage, decode


@define(eq=False)
class NewestMessage:
    """The newest message of one topic; what cannot be used counts as if it had not come.

    A message that is damaged or not of the type is `damaged`. One whose stamp is before that of the newest one is
    `late`, and is left out; one with the same stamp is `repeated`. A stamp that falls behind makes a message as old as
    it says: `lateness_s` is by how much later it came than the quickest one, and `age_s` adds it.

    A message without the `wanted` fields is of another publisher. One with other joints than the first one is
    `ambiguous`, and is left out, unless each wanted field names its joint: a place in an array would be that of another
    joint.
    """

    topic: str
    type_name: str
    wanted: frozenset[str] = frozenset()
    clock: Clock = time
    damaged: int = 0
    ambiguous: int = 0
    late: int = 0
    repeated: int = 0
    columns: Mapping[str, NDArray[np.float64]] = field(factory=dict)
    _joints: tuple[str, ...] | None = None
    _came_s: float = -inf
    _stamp_s: float = -inf
    _quickest_s: float = inf
    lateness_s: float = 0.0

    def take(self, data: bytes) -> None:
        """Receive a message. It is called in the thread of the network."""
        now_s = self.clock.monotonic()
        try:
            message = decode(self.type_name, data)
        except BadMessage:
            self.damaged += 1
            return
        columns = message_columns(message, self.topic)
        if not all(name in columns or set("*?") & set(name) for name in self.wanted):
            # Shown in an error, if no other one comes.
            self.columns = self.columns or columns
            return
        if not self._is_of_these_joints(tuple(getattr(message, "name", ()))):
            self.ambiguous += 1
            return
        stamp_s = _stamp_of(message)
        if stamp_s is not None:
            if stamp_s < self._stamp_s:
                self.late += 1
                return
            self.repeated += stamp_s == self._stamp_s
            self._stamp_s = stamp_s
            self._quickest_s = min(self._quickest_s, now_s - stamp_s)
            self.lateness_s = now_s - stamp_s - self._quickest_s
        self.columns = columns
        self._came_s = now_s

    def _is_of_these_joints(self, joints: tuple[str, ...]) -> bool:
        if self._joints is None:
            self._joints = joints
        named = all(name.rpartition(".")[2] in joints for name in self.wanted)
        return joints == self._joints or named

    @property
    def came(self) -> bool:
        """Whether a message with the wanted fields has come."""
        return self._came_s > -inf

    def age_s(self) -> float:
        """Return how old the newest message is; inf if none came."""
        return self.clock.monotonic() - self._came_s + self.lateness_s


def _stamp_of(message: Any) -> float | None:
    """Return the stamp (s) in the header of a message; None without one, or where it was not set."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is None or not (stamp.sec or stamp.nanosec):
        return None
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)
