"""Whether the fingers move as fast as they were told: a wrong scale of the gap or of the time shows in their speed."""

from __future__ import annotations

from collections import deque
from math import inf, nan
from typing import Final

from graspsense.core.grasp.protection.speed import told_speed_m_s
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import APPROACH, Command, Frame

FAST: Final = 1.5
"""Speed over the commanded one from which on the fingers are too fast; its inverse is too slow."""
FAST_S: Final = 0.2
"""Time over which a speed that is too fast is taken; at least three frames."""
LASTS_S: Final = 0.1
"""Time for which it must be too fast: a loop overshoots when it starts."""
BLOCK_S: Final = 0.3
"""Time of a block over which a speed that is too slow is taken; at least four frames."""
BLOCKS: Final = 3
STEADY_SHARE: Final = 0.1
"""Blocks in a row whose speeds differ by this share at most in a steady motion: fingers that accelerate are slow."""
LEAST_M: Final = 0.001
"""Way by which the fingers must differ from what they were told: some steps of a coarse encoder."""


class KeptSpeed:
    """Compares the way of the gap over the time with the commanded speed, for frames with this rate (Hz).

    Fingers that have kept the speed once may become slower: they may press something.
    """

    def __init__(self, rate_hz: float) -> None:
        self._fast_s, self._block_s = max(FAST_S, 3.0 / rate_hz), max(BLOCK_S, 4.0 / rate_hz)
        self._told_m_s = 0.0
        self._recent: deque[tuple[float, float]] = deque()
        self._blocks_m_s: deque[float] = deque(maxlen=BLOCKS)
        self._too_fast_s = self._block_t_s = self._block_gap_m = nan
        self._kept = False

    def apply(self, frame: Frame, command: Command, *, jumped: bool) -> None:
        """Take the command that is applied after this frame; a gap that has `jumped` has no speed."""
        told_m_s = told_speed_m_s(frame, command)
        if jumped or told_m_s != self._told_m_s:
            self._told_m_s = told_m_s
            self._recent.clear()
            self._blocks_m_s.clear()
            self._too_fast_s, self._block_t_s = 0.0, nan

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick of the approach or the release."""
        told_m_s = self._told_m_s
        if not 0.0 < abs(told_m_s) < inf:
            return None
        recent = self._recent
        recent.append((frame.t_s, frame.gap_m))
        while len(recent) > 1 and frame.t_s - recent[1][0] >= self._fast_s * (1.0 - 1e-9):
            recent.popleft()
        speed_m_s = speed_since(*recent[0], frame) * (1.0 if told_m_s > 0.0 else -1.0)
        elapsed_s = frame.t_s - recent[0][0]
        too_fast = (
            elapsed_s >= self._fast_s * (1.0 - 1e-9)
            and speed_m_s > FAST * abs(told_m_s)
            and (speed_m_s - abs(told_m_s)) * elapsed_s > LEAST_M
        )
        self._too_fast_s = self._too_fast_s + frame.dt_s if too_fast else 0.0
        if self._too_fast_s > LASTS_S:
            return self._not_kept(speed_m_s)
        return self._slow(frame) if phase == APPROACH and told_m_s > 0.0 and not self._kept else None

    def _slow(self, frame: Frame) -> Fault | None:
        """Compare the speeds of the last blocks of the approach."""
        if self._block_t_s != self._block_t_s:
            self._block_t_s, self._block_gap_m = frame.t_s, frame.gap_m
            return None
        elapsed_s = frame.t_s - self._block_t_s
        if elapsed_s < self._block_s * (1.0 - 1e-9):
            return None
        speed_m_s = speed_since(self._block_t_s, self._block_gap_m, frame)
        self._block_t_s, self._block_gap_m = frame.t_s, frame.gap_m
        self._kept = speed_m_s * FAST >= self._told_m_s
        blocks = self._blocks_m_s
        blocks.append(speed_m_s)
        steady = len(blocks) == BLOCKS and max(blocks) - min(blocks) <= STEADY_SHARE * speed_m_s
        if self._kept or not steady or not speed_m_s * elapsed_s > LEAST_M:
            return None
        return self._not_kept(speed_m_s)

    def _not_kept(self, speed_m_s: float) -> Fault:
        return Fault(
            "not the commanded speed",
            f"the fingers move at {speed_m_s * 1e3:.0f} mm/s by gap and time, and were told "
            f"{abs(self._told_m_s) * 1e3:.0f} mm/s: the scale of the gap or the clock is wrong, or the motor cannot; "
            "gaps and times can be off as much; check the encoder, the clock and the supply",
        )


def speed_since(t_s: float, gap_m: float, frame: Frame) -> float:
    """Return the closing speed from this time and gap to those of the frame; 0 without a time between."""
    elapsed_s = frame.t_s - t_s
    return (gap_m - frame.gap_m) / elapsed_s if elapsed_s > 0.0 else 0.0
