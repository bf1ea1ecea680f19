"""Whether both pads feel more than the motor may press: a motor that is too strong may report what it was told."""

from __future__ import annotations

from math import nan
from typing import Final

from graspsense.core.grasp.protection.effort_ceiling import asked_effort_n
from graspsense.core.grasp.protection.motor import (
    ALLOWED_N,
    ALLOWED_SHARE,
    PERIODS,
    STRONG_N,
    STRONG_S,
    STRONG_SHARE,
    lasting,
)
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Command, Frame

RESTS_M_S: Final = 0.0005
"""Speed below which the fingers rest: while they are braked, their mass presses too."""


class FeltForce:
    """Compares the smaller force of the pads with the largest effort that was allowed so far in the closing.

    The largest one, since fingers whose drive holds by itself press on with it. `pads_hz` is the rate of the forces, 0
    if it is not known. The friction of the drive (N; 0: it is not known) keeps what an impact has pressed; without it,
    no force ends a grasp.
    """

    def __init__(self, rate_hz: float, pads_hz: float, friction_n: float = 0.0) -> None:
        self._lasts_s = max(STRONG_S, PERIODS / rate_hz, 2.0 / pads_hz if pads_hz > 0.0 else 0.0)
        self._friction_n = friction_n
        self._allowed_n = nan
        self._more_s = self._strong_s = 0.0

    def apply(self, command: Command) -> None:
        """Take a command that closes, after its limits."""
        allowed_n = asked_effort_n(command)
        if not allowed_n <= self._allowed_n:
            self._allowed_n = allowed_n

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick while the fingers close or hold, and return a force that no command explains.

        Only fingers that rest are judged, so a gripper without a velocity is not.
        """
        felt_n, allowed_n = min(frame.force_left_n, frame.force_right_n), self._allowed_n
        rests = abs(frame.velocity_m_s) < RESTS_M_S
        held_n = felt_n - self._friction_n
        more = rests and held_n > (1.0 + ALLOWED_SHARE) * allowed_n + ALLOWED_N
        strong = rests and self._friction_n > 0.0 and held_n > (1.0 + STRONG_SHARE) * allowed_n + STRONG_N
        self._more_s = lasting(self._more_s, more, frame.dt_s)
        self._strong_s = lasting(self._strong_s, strong, frame.dt_s)
        if self._more_s <= self._lasts_s:
            return None
        return Fault(
            "stronger than commanded",
            f"both pads feel {felt_n:.1f} N, and the motor was told {allowed_n:.1f} N at most: check the scale of the "
            "motor, and the calibration of the pads",
            ends=self._strong_s > self._lasts_s,
        )
