"""Whether the clock and the cell images go on, measurements are there, frames come once, and what the status says."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from functools import reduce
from math import inf, isfinite, nan
from operator import or_
from typing import Final

from graspsense.core.grasp.protection.losses import ENDS_SHARE, FEWEST
from graspsense.core.grasp.protection.motor import RecentMean
from graspsense.core.values.faults import Fault, StatusBit
from graspsense.core.values.signals import CLOSING, Frame, Reading

STANDS_S: Final = 0.1
"""Time, counted in frames of the declared rate, for which the clock of the gripper may stand still."""
FEWEST_STILL: Final = 3
"""Frames in a row that show a clock that stands still."""
JUMP_S: Final = 0.1
"""Time between two frames, at least five periods, that is a jump of the clock or a stall."""
RECENT_S: Final = 0.2
"""Time constant of the mean speed of an approach."""
REPEATS: Final = 3
REPEATED_SHARE: Final = 0.07
"""Motions, and their share, that make up for a standstill if frames come twice."""
LONGER: Final = 0.97
CATCH_UP: Final = 1.5
"""Time of such a standstill over that of a step, and way after it over the larger of a step and the usual way."""
COARSE: Final = 3
"""Steps of a gap in a row that stood still before each of them."""
STEPS_M: Final = 0.0009
ALIKE: Final = 0.9
"""Step of the gap from which on it is coarse, and share of it that the others have."""
SURPLUS_SHARE: Final = 0.05
SURPLUS_S: Final = 0.4
SURPLUS_FRAMES: Final = 40
SURPLUS: Final = 4.0
"""Share of frames beyond the declared rate from which on the clock of the gripper counts as slow, the time and the
number of frames over which it is taken at least (at most `FEWEST`, if they take longer), and the least surplus."""
IMAGES_LATE: Final = 5.0
"""Periods of the cell images without a new one after which the forces are out of date."""
IMAGES_LATE_S: Final = 0.1
"""The least time without a new image that ends a grasp."""


ABSENT_S: Final = 0.1
"""Time for which a measurement may be no number, without a break or in all; at least three periods."""
GAP_ABSENT: Final = Fault(
    "gap absent",
    "it is no number any more, or below zero: check the encoder and the sign of the gap",
    ends=True,
)
EFFORT_ABSENT: Final = Fault(
    "effort absent",
    "the gripper does not tell its effort, so what follows from it is missing: check its current or load sensor",
)
PADS_ABSENT: Final = tuple(
    Fault(f"{side} pad absent", "it gives no force: check the fingertip and its cable", ends=True)
    for side in ("left", "right")
)


class Reports:
    """Watches the clock and the counters of a gripper with this rate of frames and of cell images (Hz; 0: none)."""

    def __init__(self, rate_hz: float, images_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._images_late_s = max(IMAGES_LATE / images_hz, IMAGES_LATE_S) if images_hz > 0.0 else 0.0
        self._stands = 0
        self._jump_s, self._jumped_s = max(JUMP_S, 5.0 / rate_hz), 0.0
        self._closing_s = self._block_s = 0.0
        self._block_frames = 0
        self._block = max(FEWEST, SURPLUS_S * rate_hz)
        self._closing = False
        self._counter = -1
        self._image_t_s = nan

    def see(self, reading: Reading, phase: int) -> Fault | None:
        """Take the reading of a tick and return a fault that it shows."""
        frame, pads, _ = reading
        closing = phase in CLOSING
        if frame.dt_s > 0.0:
            self._stands = 0
        else:
            self._stands += 1
            if self._stands >= FEWEST_STILL and self._stands * self._period_s > STANDS_S:
                return Fault(
                    "clock stands still",
                    f"the time of the gripper has not advanced in {self._stands} frames: speeds and time limits "
                    "are not valid; restart the gripper",
                    ends=True,
                )
        # The frame that ends the hold ends it because of the jump.
        closed, self._closing = self._closing, closing
        if (closing or closed) and self._closing_s and not -self._period_s < frame.dt_s < self._jump_s:
            return self._jumped(frame.dt_s)
        if pads.counter != self._counter or self._image_t_s != self._image_t_s:
            self._counter, self._image_t_s = pads.counter, frame.t_s
        elif closing and self._images_late_s > 0.0 and frame.t_s - self._image_t_s > self._images_late_s:
            return Fault(
                "cell images stopped",
                f"no new cell image for {frame.t_s - self._image_t_s:.2f} s: the forces are out of date; check the "
                "cables of the fingertips",
                ends=True,
            )
        return self._slow(frame.dt_s) if closing else None

    def _jumped(self, dt_s: float) -> Fault:
        self._jumped_s += abs(dt_s)
        return Fault(
            "clock jumps",
            f"the time of the gripper changed by {dt_s:+.2f} s from a frame to the next: its clock jumped, or this "
            "computer or the connection stood still, so that times and rates are wrong; check the connection and the "
            "load of this computer",
            ends=not self._jumped_s < ENDS_SHARE * (self._jumped_s + self._closing_s),
        )

    def _slow(self, dt_s: float) -> Fault | None:
        """Compare each block of frames with the time that it took by the clock of the gripper."""
        self._closing_s += dt_s
        self._block_frames += 1
        self._block_s += dt_s
        frames, block_s = self._block_frames, self._block_s
        if frames < max(SURPLUS_FRAMES, SURPLUS_S / self._period_s):
            return None
        if frames >= self._block:
            self._block_frames, self._block_s = 0, 0.0
        if frames * self._period_s - block_s <= max(SURPLUS_SHARE * block_s, SURPLUS * self._period_s):
            return None
        return Fault(
            "clock slow",
            f"{frames} frames came in {block_s:.2f} s of the gripper's clock, which declares "
            f"{1.0 / self._period_s:g} a second: its clock is slow, so that times and rates are wrong, or frames are "
            "repeated; restart the gripper",
        )


class Repeats:
    """Watches the gap of fingers that approach for frames that come twice: it stands still, and then makes up for it.

    A gap in steps stands still too, but not for longer than a step takes, and then moves no further than in two frames
    in a row that move. One that is measured for each n-th frame only hardly has these. Frames of this rate (Hz) that
    come early or late have a shorter or longer way, or only another time. Where the steps are coarse, and the gap
    stands still before each of them, they are told.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._gap_m, self._still_s = nan, 0.0
        self._speed_m_s = RecentMean(RECENT_S)
        self._step_m = inf
        """The least way of a frame that follows a motion."""
        self._motions = self._repeats = 0
        self._steps_m: deque[float] = deque(maxlen=COARSE)

    def see(self, frame: Frame, *, jumped: bool = False) -> Fault | None:
        """Take the frame of a tick of the approach; return what the ways of the gap show. A jump is no way."""
        way_m = nan if jumped else self._gap_m - frame.gap_m
        self._gap_m, still_s, self._still_s = frame.gap_m, self._still_s, 0.0
        if not (way_m >= 0.0 and frame.dt_s > 0.0):
            return None
        self._speed_m_s.add(way_m / frame.dt_s, frame.dt_s)
        if way_m == 0.0:
            self._still_s = still_s + min(frame.dt_s, self._period_s)
            return None
        self._motions += 1
        if still_s == 0.0:
            self._step_m = min(self._step_m, way_m)
            self._steps_m.clear()
            return None
        self._steps_m.append(way_m)
        usual_m = self._speed_m_s.value * max(frame.dt_s, self._period_s)
        is_long = self._speed_m_s.value * still_s > LONGER * self._step_m
        self._repeats += is_long and way_m > CATCH_UP * max(self._step_m, usual_m)
        return self._coarse() or self._repeated()

    def _repeated(self) -> Fault | None:
        """Return the fault of a gap that often stood still for longer than a step takes, and then moved by more."""
        if self._repeats < max(REPEATS, REPEATED_SHARE * self._motions):
            return None
        return Fault(
            "frames repeated",
            f"in the approach the gap stood still {self._repeats} times, and then made up for it: some frames come "
            "twice, so that a standstill may be none; check the connection",
        )

    def _coarse(self) -> Fault | None:
        """Return the fault of a gap that stood still before each of its last steps, if they are coarse and alike."""
        steps_m = self._steps_m
        if len(steps_m) < COARSE or min(steps_m) < max(STEPS_M, ALIKE * max(steps_m)):
            return None
        return Fault(
            "gap in steps",
            f"it moves by {max(steps_m) * 1e3:.1f} mm at once, and stands still in between: what follows from it is "
            "off by up to that; check the encoder",
        )


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
        closing = phase in CLOSING
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


class Absence:
    """Watches one measurement with this rate (Hz), whose absence is this fault. Infinity is absence too.

    One that is not `expected` is missed only after it was there.
    """

    def __init__(self, fault: Fault, rate_hz: float, *, expected: bool) -> None:
        self._fault, self._expected = fault, expected
        self._allowed_s = max(ABSENT_S, 3.0 / rate_hz)
        self._absent_s = self._all_absent_s = 0.0

    def see(self, value: float, frame: Frame) -> Fault | None:
        """Take the value of the measurement in this frame; return the fault once it has been no number for too long.

        One that is no number again and again has the fault too, which then does not end the grasp.
        """
        is_known = isfinite(value)
        self._expected = self._expected or is_known
        missing_s = 0.0 if is_known or not self._expected else frame.dt_s
        self._all_absent_s += missing_s
        self._absent_s = self._absent_s + missing_s if not is_known else 0.0
        if self._absent_s > self._allowed_s:
            return self._fault
        if is_known or self._all_absent_s <= self._allowed_s:
            return None
        return Fault(
            self._fault.name,
            f"it was no number for {self._all_absent_s:.2f} s in all, so that what follows from it is wrong or "
            "missing: check its sensor and the connection",
        )
