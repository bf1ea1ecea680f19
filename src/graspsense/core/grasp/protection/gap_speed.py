"""Whether the gap moves as the velocity says: an encoder that stands still, or a speed that does not follow."""

from __future__ import annotations

from math import exp, nan
from typing import Final

from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame

MEMORY_S: Final = 0.5
"""Time constant over which travels are summed."""
ALLOWED_SHARE: Final = 0.5
ALLOWED_M: Final = 0.00075
"""By how much both travels may differ: a filtered velocity is late, and a gap has steps."""
LASTS_S: Final = 0.1
"""Time for which they must differ by more; at least three frames."""


class GapSpeed:
    """Compares the travel of the gap with that of the velocity, over the last half second of a closing."""

    def __init__(self, rate_hz: float) -> None:
        self._lasts_s = max(LASTS_S, 3.0 / rate_hz)
        self._gap_m = nan
        self._moved_m = self._said_m = self._differs_s = 0.0
        self._is_measured = False

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick while the fingers close or hold.

        A gripper without gap or velocity shows nothing, nor does one whose velocity has been 0 so far.
        """
        step_m, said_m = frame.gap_m - self._gap_m, frame.velocity_m_s * frame.dt_s
        self._gap_m = frame.gap_m
        self._is_measured = self._is_measured or said_m != 0.0
        if step_m != step_m or said_m != said_m or not self._is_measured:
            return None
        kept = exp(-frame.dt_s / MEMORY_S)
        self._moved_m = kept * self._moved_m + step_m
        self._said_m = kept * self._said_m + said_m
        largest_m = max(abs(self._moved_m), abs(self._said_m))
        differs = abs(self._moved_m - self._said_m) > ALLOWED_M + ALLOWED_SHARE * largest_m
        self._differs_s = self._differs_s + frame.dt_s if differs else 0.0
        if self._differs_s <= self._lasts_s:
            return None
        return Fault(
            "gap and velocity disagree",
            f"the gap changed by {self._moved_m * 1e3:+.1f} mm where the velocity says {self._said_m * 1e3:+.1f} mm: "
            "one of them is wrong; check the encoder and its scale",
            ends=True,
        )
