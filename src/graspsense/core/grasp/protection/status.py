"""The status bits of a gripper: each has a word, and a time after which it ends the grasp."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from math import inf
from operator import or_

from graspsense.core.values.faults import Fault, StatusBit
from graspsense.core.values.signals import APPROACH, HOLD, SQUEEZE, Frame


class StatusWatch:
    """Watches the status of each frame for the bits that the gripper has declared, and for others."""

    def __init__(self, bits: Sequence[StatusBit]) -> None:
        self._bits = tuple(bits)
        self._known = reduce(or_, (bit.mask for bit in self._bits), 0)
        self._seconds = [0.0] * len(self._bits)

    def see(self, frame: Frame, phase: int) -> list[Fault]:
        """Return the faults that the bits of this frame show; none in most ticks."""
        status = frame.status
        if not status or not self._bits:
            return []
        closing = phase in (APPROACH, SQUEEZE, HOLD)
        faults: list[Fault] = []
        for i, bit in enumerate(self._bits):
            if status & bit.mask:
                if closing:
                    self._seconds[i] += max(frame.dt_s, 0.0)
                faults.append(Fault(bit.name, bit.meaning, ends=closing and self._seconds[i] > bit.limit_s))
        unknown = status & ~self._known
        if unknown:
            faults.append(
                Fault(f"status {unknown:#x}", "the gripper does not say what this bit of its status means")
            )
        return faults

    def before_closing(self, frame: Frame) -> list[Fault]:
        """Return the faults for which the fingers must not close."""
        return [
            Fault(bit.name, bit.meaning, ends=True)
            for bit in self._bits
            if frame.status & bit.mask and bit.limit_s < inf
        ]
