"""The opening of the fingers: how wide they are before they close, when they open again, and how wide they are then.

A gap that is wrong while the fingers close, because its encoder stands still, drifts or has jumped, seldom comes back
to the width from which it began.
"""

from __future__ import annotations

from math import inf, nan
from typing import Final

from graspsense.core.grasp.protection.pad_curves import SLACK_M
from graspsense.core.grasp.protection.pad_forces import FREE_SHARE
from graspsense.core.grasp.protection.touch import CLOSED_M
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import APPROACH, EFFORT, POSITION, Command, Frame, Phase

LEAST_TRAVEL_M: Final = 0.0015
"""Travel of the closing from which on the opening must show."""
STOOD_S: Final = 0.4
"""Time of a closing from which on a gap that never changed is told."""
OPENED_M: Final = 0.001
"""Change of the gap that shows it."""
LATE_S: Final = 0.16
"""Time beyond the delay of a command after which the gap is late; at least four frames. Set with emulated grippers."""
STANDS_S: Final = 0.5
"""Time beyond it after which the fingers count as not opened; at least six frames."""
LET_GO_S: Final = 0.04
FEWEST_LATE: Final = 4
"""Time, in which more than so many frames have come, for which pads may be free before the gap opens."""
RESTED_S: Final = 0.1
"""Time for which fingers must have rested that have to open at once: others brake first."""
TARGET_M: Final = 0.002
TARGET_SHARE: Final = 0.05
"""By how much open fingers may miss the width that they were told, at least and as a share of it."""
STOP: Final = 2.0
"""Effort over the friction of the drive with which fingers open until a stop."""
AGAIN_M: Final = 0.001
AGAIN_SHARE: Final = 0.01
"""By how much their width after a grasp may differ from that before it, at least and as a share of it."""


class Opening:
    """Watches the gap of a gripper with this rate of frames (Hz) and delay of commands (s), which this command opens.

    `tells_gap` says whether the frames have a gap at all, and `friction_n` is that of the drive (N; 0: not known),
    and `open_gap_m` the gap of open fingers where the command does not say it. Pads that held an object with
    `contact_n` let go when the fingers open; pads that are slow do so later, and show nothing.
    """

    def __init__(
        self,
        rate_hz: float,
        command_delay_s: float,
        opening: Command | None,
        tells_gap: bool,
        friction_n: float = 0.0,
        open_gap_m: float = nan,
        contact_n: float = inf,
    ) -> None:
        self._late_s = command_delay_s + max(LATE_S, 4.0 / rate_hz)
        self.stands_s = command_delay_s + max(STANDS_S, 6.0 / rate_hz)
        """Time (s) after which fingers that stand still have not opened."""
        self._target_m = opening.value if opening is not None and opening.kind == POSITION else nan
        self._longest_s = nan if opening is None else self.stands_s + self._target_m / opening.speed_limit_m_s
        self._tells_gap = tells_gap
        self._width_m = self._target_m if self._target_m == self._target_m else open_gap_m
        self._ends_alike = self._width_m == self._width_m or (
            opening is not None and opening.kind == EFFORT and -opening.value >= STOP * friction_n > 0.0
        )
        self._first_m = nan
        self._widest_m, self._began_s = -inf, nan
        self._start_m = self._start_s = self._rest_m = self._rest_s = nan
        self._opened = self._held = False
        self._contact_n = contact_n
        self._gap_m = self._free_t_s = nan
        self._free_frames = 0

    def before_closing(self, frame: Frame) -> Fault | None:
        """Take the frame in which the fingers are open; return what is wrong with their width."""
        gap_m = self._first_m = frame.gap_m
        if gap_m <= CLOSED_M or (gap_m != gap_m and self._tells_gap):
            is_told = "is no number" if gap_m != gap_m else f"is {gap_m * 1e3:.1f} mm"
            return Fault(
                "fingers not open",
                f"their gap {is_told} after they were told to open: something holds them, the encoder fails, or it "
                "counts the other way; look at the fingers, the encoder and the sign of the gap",
                ends=True,
            )
        if not abs(gap_m - self._width_m) > max(TARGET_M, TARGET_SHARE * self._width_m):
            return None
        return Fault(
            "opened to another width",
            f"the fingers open to {self._width_m * 1e3:.1f} mm, and their gap is {gap_m * 1e3:.1f} mm: something holds "
            "them, or all gaps are off by as much; look at the fingers, and at the zero and the scale of the encoder",
        )

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick; return what is wrong with the opening after the grasp."""
        last_m, self._gap_m = self._gap_m, frame.gap_m
        if phase != Phase.RELEASE:
            if phase >= APPROACH:
                self._closes(frame)
            return None
        if self._opened:
            return None
        closed_m, elapsed_s = self._widest_m - self._start_m, frame.t_s - self._start_s
        # A gap that is late closes on for a while, as that of fingers which brake.
        self._start_m = min(self._start_m, frame.gap_m)
        opened_m = frame.gap_m - self._start_m
        self._opened = opened_m >= OPENED_M
        let_go_s = self._let_go_s(frame)
        if not closed_m >= LEAST_TRAVEL_M:
            return self._stood(self._start_s - self._began_s) if closed_m == 0.0 else None
        if self._opened:
            # When it began, by its speed: a frame can come long after that.
            began_s = elapsed_s - frame.dt_s * opened_m / max(frame.gap_m - last_m, SLACK_M)
            if self._start_s - self._rest_s < RESTED_S or not began_s > self._late_s:
                return None
            return self._late(f"it changed only {began_s:.2f} s after the fingers were told to open")
        if elapsed_s < self.stands_s:
            if not (let_go_s > LET_GO_S and opened_m <= SLACK_M):
                return None
            return self._late(f"both pads let go {let_go_s:.2f} s ago, and it has not changed yet")
        return Fault(
            "fingers did not open",
            f"the gap still is {frame.gap_m * 1e3:.1f} mm, {elapsed_s:.1f} s after they were told to: they hold on, or "
            "the gap has stood still for longer, so that what follows from it is wrong; look at the fingers and the "
            "encoder",
        )

    def _closes(self, frame: Frame) -> None:
        """Take the frame of a tick before the release."""
        if self._began_s != self._began_s:
            self._began_s = frame.t_s
        self._widest_m = max(self._widest_m, frame.gap_m)
        self._start_m, self._start_s = frame.gap_m, frame.t_s
        if not abs(frame.gap_m - self._rest_m) < OPENED_M:
            self._rest_m, self._rest_s = frame.gap_m, frame.t_s
        self._held = min(frame.force_left_n, frame.force_right_n) >= self._contact_n
        self._free_t_s = frame.t_s

    def _let_go_s(self, frame: Frame) -> float:
        """Return for how long (s) pads that held an object have been free; 0 in the first frames."""
        if not max(frame.force_left_n, frame.force_right_n) < FREE_SHARE * self._contact_n:
            self._free_t_s, self._free_frames = frame.t_s, 0
            return 0.0
        self._free_frames += 1
        return frame.t_s - self._free_t_s if self._held and self._free_frames > FEWEST_LATE else 0.0

    def unknown_s(self, gap_m: float) -> float:
        """Return for how long (s) from their command on it is not known whether fingers at this gap are open.

        A gap that stands still or has jumped is no witness. Then only the time tells in which they open from any width.
        """
        if self._target_m != self._target_m:
            return 0.0 if self.is_open(gap_m) else self.stands_s
        return 0.0 if self._opened and self._is_as_before(gap_m) else self._longest_s

    def is_open(self, gap_m: float) -> bool:
        """Return whether fingers at this gap have opened by half of the way that they had closed, if they had."""
        closed_m = self._widest_m - self._start_m
        half = gap_m - self._start_m >= 0.5 * closed_m
        return (self._opened and half) or self._is_as_before(gap_m) or closed_m < LEAST_TRAVEL_M

    def released(self, frame: Frame) -> Fault | None:
        """Take the last frame of the release; return what is wrong with the width of the open fingers.

        Fingers that are opened by little effort or a velocity may end anywhere.
        """
        first_m, gap_m = self._first_m, frame.gap_m
        # Fingers that are seen not to open have a fault of their own.
        if (
            not self._opened
            or not self._ends_alike
            or gap_m - first_m != gap_m - first_m
            or self._is_as_before(gap_m)
        ):
            return None
        return Fault(
            "gap not as before",
            f"open fingers are at {gap_m * 1e3:.1f} mm, and were at {first_m * 1e3:.1f} mm before the grasp: something "
            "holds them, or the gap drifts or has jumped, so that what follows from it is wrong; look at the fingers "
            "and the encoder",
        )

    def _is_as_before(self, gap_m: float) -> bool:
        return abs(gap_m - self._first_m) <= max(AGAIN_M, AGAIN_SHARE * self._first_m)

    def _stood(self, closing_s: float) -> Fault | None:
        if not closing_s > STOOD_S:
            return None
        return Fault(
            "fingers stand still",
            f"the gap has not changed in {closing_s:.1f} s of closing: if the fingers moved, it is wrong, and the "
            "object is not too wide; look at the fingers and the encoder",
        )

    def _late(self, what: str) -> Fault:
        return Fault(
            "gap late", f"{what}: times and rates of the squeeze can be off by that; check the connection"
        )
