"""A pad whose force stands still in the squeeze while that of the other pad changes."""

from __future__ import annotations

from math import nan
from typing import Final

from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame

STILL_S: Final = 0.25
"""Least time for which the force of a pad stands still."""
IMAGES: Final = 5.0
"""Periods of the pads for which it stands still at least."""
CHANGE_N: Final = 1.0
"""Change of the other pad's force in that time that a sound pad would have felt too."""


class StuckForce:
    """Compares the forces of both pads from the contact on; for grippers without noise or without cells too.

    `pads_hz` is the rate of the forces, 0 if it is not known.
    """

    def __init__(self, pads_hz: float) -> None:
        self._still_s = max(STILL_S, IMAGES / pads_hz) if pads_hz > 0.0 else STILL_S
        self._forces = (nan, nan)
        self._since: list[float] = [nan, nan]
        self._others: list[float] = [nan, nan]

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick of the squeeze or the hold, and return a pad that it shows to be stuck."""
        forces = (frame.force_left_n, frame.force_right_n)
        for i, side in enumerate(("left", "right")):
            if forces[i] != self._forces[i]:
                self._since[i], self._others[i] = frame.t_s, forces[1 - i]
            elif (
                frame.t_s - self._since[i] >= self._still_s
                and abs(forces[1 - i] - self._others[i]) >= CHANGE_N
                and self._forces[1 - i] == self._forces[1 - i]
            ):
                return Fault(
                    f"{side} pad stuck",
                    f"its force has stood at {forces[i]:.2f} N for {frame.t_s - self._since[i]:.2f} s, while that of "
                    f"the other pad went from {self._others[i]:.2f} to {forces[1 - i]:.2f} N: check its cable",
                    ends=True,
                )
        self._forces = forces
        return None
