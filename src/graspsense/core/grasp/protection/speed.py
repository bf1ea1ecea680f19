"""Whether the gap moves as velocity and command say, and whether fingers approach too fast, not at all, or in a jump.

An encoder can stand still, and a gripper that closes by itself may take no limit of the speed. A wrong scale of the gap
or of the time shows in the speed over the commanded one.
"""

from __future__ import annotations

from collections import deque
from math import exp, inf, nan
from typing import Final

from graspsense.core.grasp.protection.effort_ceiling import asked_effort_n
from graspsense.core.grasp.protection.motor import ALLOWED_N, RecentMean, direction_of
from graspsense.core.grasp.protection.touch import CLOSED_M
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import APPROACH, EFFORT, FORCE, POSITION, VELOCITY, Command, Frame

MEMORY_S: Final = 0.5
"""Time constant over which travels are summed."""
ALLOWED_SHARE: Final = 0.5
ALLOWED_M: Final = 0.00075
"""By how much both travels may differ: a filtered velocity is late, and a gap has steps."""
WAY_SHARE: Final = 0.25
"""By how much the way of the whole closing may differ, as a share: then the velocity is late no more."""
LASTS_S: Final = 0.1
"""Time for which they must differ by more, at least three frames, or be too fast: a loop overshoots when it starts."""
RUSH: Final = 3.0
"""Speed over the limit of a first use from which on the fingers rush: a loop overshoots when it starts."""
RUSH_S: Final = 0.1
"""Time for which they must do so; at least three frames."""
STILL_M: Final = 0.001
"""Travel of the gap below which the fingers stand still: more than a step of a coarse encoder."""
STILL_S: Final = 3.0
"""Time for which fingers that are told to close may stand still."""
TOLD_M: Final = 0.003
"""Travel that they must have been told in this time."""
JUMP: Final = 3.0
ARRIVES_S: Final = 0.02
"""Speed over the commanded one that fingers can have between two frames. Their times are those of their arrival: up to
this time it is taken over two frames."""
JUMP_M: Final = 0.001
JUMP_STEPS: Final = 3.0
FREE_M_S: Final = 0.3
"""Change of the gap between two frames that is no jump at most: so many steps of the encoder, or the way at this speed,
at which an object that breaks lets the fingers move."""
FEW_JUMPS: Final = 4
"""Jumps of a gap to one side, for each to the other side and one more, that are not taken for motion."""


FAST: Final = 1.5
"""Speed over the commanded one from which on the fingers are too fast; its inverse is too slow."""
FAST_ENDS: Final = 2.0
"""Speed over the commanded one that ends an approach, beyond the limit of a first use: the fingers meet the object with
four times the energy."""
FAST_S: Final = 0.2
"""Time over which a speed that is too fast is taken; at least three frames."""
BLOCK_S: Final = 0.3
"""Time of a block over which a speed that is too slow is taken; at least four frames."""
BLOCKS: Final = 3
STEADY_SHARE: Final = 0.2
"""Blocks in a row whose speeds differ by this share at most in a steady motion: fingers that accelerate are slow."""
QUICK: Final = 1.2
"""Speed of a steady motion, over the commanded one, from which on the fingers are too fast."""
AT_LIMIT: Final = 0.9
"""Share of the limit of the effort from which on slow fingers may press something."""
LEAST_M: Final = 0.001
"""Way by which the fingers must differ from what they were told: some steps of a coarse encoder."""


class GapSpeed:
    """Compares the travel of the gap with that of the velocity, over the last half second and the whole closing.

    `declared` says that the gripper measures its velocity: one that is 0 from the beginning on is wrong then.
    """

    def __init__(self, rate_hz: float, declared: bool = False) -> None:
        self._lasts_s = max(LASTS_S, 3.0 / rate_hz)
        self._gap_m = nan
        self._moved_m = self._said_m = self._differs_s = 0.0
        self._way_m = self._said_way_m = self._ways_differ_s = 0.0
        self._is_measured = declared

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick while the fingers close or hold.

        A gripper without gap or velocity shows nothing, nor does one whose velocity has been 0 so far if it does not
        declare that it measures it.
        """
        step_m, said_m = frame.gap_m - self._gap_m, frame.velocity_m_s * frame.dt_s
        self._gap_m = frame.gap_m
        self._is_measured = self._is_measured or said_m != 0.0
        if step_m != step_m or said_m != said_m or frame.dt_s < 0.0 or not self._is_measured:
            return None
        kept = exp(-frame.dt_s / MEMORY_S)
        self._moved_m, self._said_m = kept * self._moved_m + step_m, kept * self._said_m + said_m
        self._way_m, self._said_way_m = self._way_m + step_m, self._said_way_m + said_m
        differs = disagree(self._moved_m, self._said_m, ALLOWED_SHARE)
        self._differs_s = self._differs_s + frame.dt_s if differs else 0.0
        ways_differ = disagree(self._way_m, self._said_way_m, WAY_SHARE)
        self._ways_differ_s = self._ways_differ_s + frame.dt_s if ways_differ else 0.0
        ends = self._differs_s > self._lasts_s
        if not (ends or self._ways_differ_s > self._lasts_s):
            return None
        moved_m, said_m = (self._moved_m, self._said_m) if ends else (self._way_m, self._said_way_m)
        return Fault(
            "gap and velocity disagree",
            f"the gap changed by {moved_m * 1e3:+.1f} mm where the velocity says {said_m * 1e3:+.1f} mm: "
            "one of them is wrong; check the encoder and its scale",
            ends=ends,
        )


def disagree(moved_m: float, said_m: float, share: float) -> bool:
    """Return whether two travels differ by more than this share of the larger one."""
    return abs(moved_m - said_m) > ALLOWED_M + share * max(abs(moved_m), abs(said_m))


class Standstill:
    """Watches whether the fingers move in the approach, where the command says at which speed they should."""

    def __init__(self) -> None:
        self._gap_m = self._since_s = nan

    def see(self, frame: Frame, command: Command) -> Fault | None:
        """Take a frame of the approach with its command, and return the fault if the fingers stand still."""
        closing_m_s = told_speed_m_s(frame, command)
        if not closing_m_s > 0.0 or frame.gap_m <= CLOSED_M or not abs(frame.gap_m - self._gap_m) < STILL_M:
            self._gap_m, self._since_s = frame.gap_m, frame.t_s
            return None
        still_s = frame.t_s - self._since_s
        if still_s <= max(STILL_S, TOLD_M / closing_m_s):
            return None
        return Fault(
            "fingers stand still",
            f"they are told to close, and have been at {frame.gap_m * 1e3:.1f} mm for {still_s:.0f} s: look for an "
            "emergency stop, a thing that blocks them, or one that is too wide for the opening",
            ends=True,
        )


class GapJump:
    """Watches for a gap that changes faster than fingers with this limit of the speed move under their commands."""

    def __init__(self, speed_limit_m_s: float, rate_hz: float) -> None:
        self._limit_m_s, self._free_m, self._least_m = speed_limit_m_s, FREE_M_S / rate_hz, JUMP_M
        self._gap_m, self._dt_s = nan, 0.0
        # What moves the fingers at first, or how old the first gap is, is not known.
        self._told_m_s = [inf, inf]
        self._direction, self._effort = 0, False
        self._velocity_m_s, self._moved = 0.0, False
        self.step_m = 0.0
        """The jump of the last frame (m), 0 without one."""
        self._opens = self._closes = 0

    def apply(self, frame: Frame, command: Command) -> None:
        """Take the command that is applied after this frame; that of an effort leaves the speed to the gripper."""
        kind, value, _, speed_limit_m_s = command
        speed_m_s = min(inf if kind == EFFORT else speed_limit_m_s, self._limit_m_s)
        self._told_m_s = [self._told_m_s[1], min(abs(value), speed_m_s) if kind == VELOCITY else speed_m_s]
        # An object can push fingers open that press with an effort.
        self._direction = 0 if kind == EFFORT else direction_of(command, frame.gap_m)
        self._effort = kind == EFFORT

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick; return the jump that it shows."""
        # A clock that goes back has a fault of its own.
        dt_s = max(frame.dt_s, 0.0)
        step_m, elapsed_s = frame.gap_m - self._gap_m, max(dt_s, min(dt_s + self._dt_s, ARRIVES_S))
        self._gap_m, self._dt_s = frame.gap_m, dt_s
        told_m_s = max(self._told_m_s)
        if self._effort:
            told_m_s = min(told_m_s, self._measured_m_s(frame.velocity_m_s))
        against = step_m * self._direction > 0.0
        if step_m != 0.0:
            self._least_m = min(self._least_m, abs(step_m))
        allowed_m = min(max(JUMP_STEPS * self._least_m, self._free_m), JUMP_M)
        allowed_m += told_m_s * dt_s if against else JUMP * told_m_s * elapsed_s
        if not abs(step_m) > allowed_m:
            self.step_m = 0.0
            return None
        self.step_m = step_m
        self._opens, self._closes = self._opens + (step_m > 0.0), self._closes + (step_m < 0.0)
        return Fault(
            "gap jumps",
            f"it changed by {step_m * 1e3:+.1f} mm within {frame.dt_s * 1e3:.0f} ms, faster than the fingers move "
            "or were told to: it is wrong before or after that, and so may be what follows from it; check the encoder",
        )

    @property
    def is_motion(self) -> bool:
        """Whether the jumps go to one side, so that the fingers may move as fast as they say; noise jumps back."""
        fewer, more = sorted((self._opens, self._closes))
        return more > FEW_JUMPS * (1 + fewer)

    def _measured_m_s(self, velocity_m_s: float) -> float:
        """Return the larger speed of this frame and the one before; infinity if it is not measured."""
        last_m_s, self._velocity_m_s = self._velocity_m_s, velocity_m_s
        self._moved = self._moved or abs(velocity_m_s) > 0.0
        return max(abs(velocity_m_s), abs(last_m_s)) if self._moved else inf


class KeptSpeed:
    """Compares the way of the gap over the time with the commanded speed, for frames with this rate (Hz).

    Fingers that have kept the speed once may become slower: they may press something, unless their effort stays what it
    was. Whatever they are commanded, they rush in an approach well beyond `limit_m_s`, that of a first use.
    """

    def __init__(self, rate_hz: float, limit_m_s: float = inf) -> None:
        self._limit_m_s, self._rush_s = limit_m_s, 0.0
        self._rush_lasts_s = max(RUSH_S, 3.0 / rate_hz)
        self._fast_s, self._block_s = max(FAST_S, 3.0 / rate_hz), max(BLOCK_S, 4.0 / rate_hz)
        self._told_m_s = 0.0
        self._recent: deque[tuple[float, float]] = deque()
        self._blocks_m_s: deque[float] = deque(maxlen=BLOCKS)
        self._too_fast_s = self._block_t_s = self._block_gap_m = nan
        self._effort_n, self._limit_n = RecentMean(self._block_s), nan
        self._kept, self._free_n = False, nan
        """Whether they have kept the speed, and their effort when they last did."""

    def apply(self, frame: Frame, command: Command, *, jumped: bool) -> None:
        """Take the command that is applied after this frame; a gap that has `jumped` has no speed."""
        told_m_s, self._limit_n = told_speed_m_s(frame, command), asked_effort_n(command)
        if jumped or told_m_s != self._told_m_s:
            self._told_m_s = told_m_s
            self._recent.clear()
            self._blocks_m_s.clear()
            self._too_fast_s, self._block_t_s = 0.0, nan

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick of the release, or of an approach in which nothing has been felt."""
        rushes = phase == APPROACH and -frame.velocity_m_s > RUSH * self._limit_m_s
        self._rush_s = self._rush_s + frame.dt_s if rushes else 0.0
        if self._rush_s > self._rush_lasts_s:
            return Fault(
                "fingers rush",
                f"they close at {-frame.velocity_m_s * 1e3:.0f} mm/s, and {self._limit_m_s * 1e3:.0f} mm/s are allowed "
                "before a contact (run.first_speed_m_s): the gripper does not keep the speed of its commands, or "
                "its gap is in another unit; send it a position or a velocity instead of an effort, and give metres",
                ends=True,
            )
        self._effort_n.add(frame.effort_n, frame.dt_s)
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
            return self._not_kept(speed_m_s, ends=speed_m_s > max(FAST_ENDS * abs(told_m_s), self._limit_m_s))
        return self._steady(frame) if phase == APPROACH and told_m_s > 0.0 else None

    def _steady(self, frame: Frame) -> Fault | None:
        """Compare the speeds of the last blocks of the approach."""
        if self._block_t_s != self._block_t_s:
            self._block_t_s, self._block_gap_m = frame.t_s, frame.gap_m
            return None
        elapsed_s = frame.t_s - self._block_t_s
        if elapsed_s < self._block_s * (1.0 - 1e-9):
            return None
        speed_m_s = speed_since(self._block_t_s, self._block_gap_m, frame)
        self._block_t_s, self._block_gap_m = frame.t_s, frame.gap_m
        slow, effort_n = speed_m_s * FAST < self._told_m_s, self._effort_n.value
        if not slow:
            self._kept, self._free_n = True, effort_n
        blocks = self._blocks_m_s
        blocks.append(speed_m_s)
        steady = len(blocks) == BLOCKS and max(blocks) - min(blocks) <= STEADY_SHARE * speed_m_s
        if not steady or not speed_m_s * elapsed_s > LEAST_M:
            return None
        presses = self._kept and not effort_n < min(self._free_n + ALLOWED_N, AT_LIMIT * self._limit_n)
        if speed_m_s <= QUICK * self._told_m_s and (presses or not slow):
            return None
        return self._not_kept(speed_m_s)

    def _not_kept(self, speed_m_s: float, *, ends: bool = False) -> Fault:
        return Fault(
            "not the commanded speed",
            f"the fingers move at {speed_m_s * 1e3:.0f} mm/s by gap and time, and were told "
            f"{abs(self._told_m_s) * 1e3:.0f} mm/s: the scale of the gap or the clock is wrong, or the motor cannot; "
            "gaps and times can be off as much; check the encoder, the clock and the supply",
            ends=ends,
        )


def speed_since(t_s: float, gap_m: float, frame: Frame) -> float:
    """Return the closing speed from this time and gap to those of the frame; 0 without a time between."""
    elapsed_s = frame.t_s - t_s
    return (gap_m - frame.gap_m) / elapsed_s if elapsed_s > 0.0 else 0.0


def told_speed_m_s(frame: Frame, command: Command) -> float:
    """Return the speed at which this command tells the fingers to move, below 0 to open; 0 where it does not say."""
    kind, value, _, speed_limit_m_s = command
    if kind == EFFORT:
        return 0.0
    if kind == POSITION:
        return speed_limit_m_s if value < frame.gap_m else -speed_limit_m_s if value > frame.gap_m else 0.0
    if kind == FORCE:
        return speed_limit_m_s if value > 0.0 else 0.0
    return min(max(-value, -speed_limit_m_s), speed_limit_m_s)
