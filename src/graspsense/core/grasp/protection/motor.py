"""Whether the motor does what it is commanded: as much, not more, and in the right direction.

A motor that is too strong may report what it was told. What the pads feel shows it, and fingers that move with less
effort than their friction takes.
"""

from __future__ import annotations

from collections import deque
from math import nan
from typing import Final, NamedTuple

from graspsense.core.grasp.protection.effort_ceiling import asked_effort_n
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import (
    APPROACH,
    CLOSING,
    EFFORT,
    FORCE,
    HOLD,
    POSITION,
    VELOCITY,
    Command,
    Frame,
)


class RecentMean:
    """A mean that forgets: each value counts less by a factor e after `time_s`."""

    def __init__(self, time_s: float) -> None:
        self._time_s, self._seen_s = time_s, 0.0
        self.value = nan

    def add(self, value: float, dt_s: float) -> None:
        """Add a value that held for this time."""
        if not (dt_s > 0.0 and value == value):
            return
        self._seen_s += dt_s
        # The plain mean until the time constant has passed.
        share = dt_s / min(self._seen_s, self._time_s) if self._seen_s > dt_s else 1.0
        self.value = value if share >= 1.0 else self.value + share * (value - self.value)


REVERSED: Final = "motor reversed"
DELAY_S: Final = 0.03
"""Time within which the motor must follow a command: a command and its answer each take a few ticks."""
PERIODS: Final = 3.0
"""Periods of the frames that this and other times last at least."""
ALLOWED_SHARE: Final = 0.25
ALLOWED_N: Final = 1.5
"""By how much the answered effort may differ from the commanded one."""
STRONG_SHARE: Final = 0.5
STRONG_N: Final = 3.0
"""By how much an effort above the command ends the grasp."""
UNLIMITED_SHARE: Final = 2.0
"""Share by which an effort that the gripper chooses itself may be above its limit: the scale of a current is unsure.
Set with emulated motors."""
LASTS_S: Final = 0.03
"""Time for which a difference must last to be a fault of the motor."""
STRONG_S: Final = 0.3
"""Time for which a motor may answer somewhat more than its command before the grasp ends. Set with emulated motors."""
WEAK_S: Final = 0.5
"""Time for which a motor may answer less than its command, which crushes nothing, before the grasp ends."""
OFF_SHARE: Final = 0.1
OFF_N: Final = 0.5
OFF_S: Final = 0.1
"""By how much the mean answer in the hold may differ, and after which time: forces at rest are off by as much."""
WRONG_WAY_M: Final = 0.003
"""Travel against the command from which on the motor turns the wrong way round."""
REBOUND_M: Final = 0.012
REBOUND_SHARE: Final = 0.5
"""Travel for which fingers that met something rebound at most, and its share of the way that they had closed by."""
COAST_S: Final = 0.25
"""Time for which fingers that close fast, and slow down, may move on under a command that opens them."""
RESTS_M_S: Final = 0.0005
"""Speed below which the fingers rest: while they are braked, their mass presses too."""
MEAN_S: Final = 0.2
"""Time over which the effort is averaged."""
FREE_TRAVEL_M: Final = 0.005
"""Travel before the effort is judged: the fingers start with more than they then need."""
MOVES_M_S: Final = 0.001
"""Speed from which on the fingers move."""
EASY_WARNS: Final = 0.6
EASY_ENDS: Final = 0.4
"""Shares of the friction below which the effort is told, and ends the grasp: what moves needs less than what starts."""


class Asked(NamedTuple):
    """A command: its time (s), its effort (N, NaN for other kinds), and its direction (1 closes, -1 opens)."""

    t_s: float
    effort_n: float
    direction: int


def direction_of(command: Command, gap_m: float) -> int:
    """Return 1 for a command that closes the fingers, -1 for one that opens them, and 0 for neither for certain."""
    kind, value, _, _ = command
    if kind in (EFFORT, FORCE):
        strong = value > ALLOWED_N or value < -ALLOWED_N
        return (1 if value > 0.0 else -1) if strong else 0
    if kind == POSITION:
        far = abs(value - gap_m) > WRONG_WAY_M
        return (1 if value < gap_m else -1) if far else 0
    return (value < 0.0) - (value > 0.0)


def lasting(seconds: float, present: bool, dt_s: float) -> float:
    """Return for how long (s) a difference has been there; it is forgotten at half the rate at which it is gathered.

    A command that the guard switches on and off at a limit of the speed shows a difference in half of the ticks only.
    A time that goes back or is no number counts as none: the clock has a fault of its own.
    """
    dt_s = dt_s if dt_s > 0.0 else 0.0
    return seconds + dt_s if present else max(seconds - 0.5 * dt_s, 0.0)


class Motor:
    """Compares the effort that the gripper reports with the commands, and the motion with their direction.

    Commands of an effort are compared with the answer, and others by the largest effort that they have allowed so far,
    since a drive that locks itself holds on with it. `reports_effort` says whether the frames have an effort at
    all, and `rate_hz` is their rate.
    """

    def __init__(self, reports_effort: bool, rate_hz: float) -> None:
        self._reports_effort = reports_effort
        self._delay_s = max(DELAY_S, PERIODS / rate_hz)
        self._lasts_s = max(LASTS_S, PERIODS / rate_hz)
        self._commands: deque[Asked] = deque()
        self._allowed_n = nan
        self._direction_t_s = nan
        """The time since when all commands have the direction of the last one."""
        self._strong_s = self._weak_s = self._reversed_s = 0.0
        self._wrong_way_s = self._held_s = 0.0
        self._held_n, self._asked_n = RecentMean(MEAN_S), RecentMean(MEAN_S)
        self._phase = -1
        self._start_m = self._extreme_m = nan
        self._start_m_s = nan
        self._gap_jumped = False

    def apply(self, frame: Frame, command: Command) -> None:
        """Take the command that is applied after this frame."""
        effort_n = command.value if command.kind == EFFORT else nan
        asked = Asked(frame.t_s, effort_n, direction_of(command, frame.gap_m))
        chooses = asked.direction == 1 and command.kind in (POSITION, VELOCITY)
        if chooses and not command.effort_limit_n <= self._allowed_n:
            self._allowed_n = command.effort_limit_n
        # Where the clock of the gripper stands still, the commands would gather.
        commands = self._commands
        if not commands or asked.direction != commands[-1].direction:
            self._direction_t_s = frame.t_s
        if not commands or asked != commands[-1]:
            commands.append(asked)

    def shift(self, step_m: float) -> None:
        """Let the gap jump by this (m), which is no motion of the fingers; `nan`: what seemed jumps was one."""
        self._gap_jumped = step_m == step_m
        if self._gap_jumped:
            self._start_m += step_m
            self._extreme_m += step_m

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick and return a fault that it shows."""
        commands = self._commands
        while len(commands) > 1 and commands[1].t_s <= frame.t_s - self._delay_s:
            commands.popleft()
        if not commands or frame.t_s - commands[0].t_s < self._delay_s:
            return None
        turned = self._wrong_way(frame, phase)
        if turned is not None or not self._reports_effort or frame.effort_n != frame.effort_n:
            return turned
        efforts = [asked.effort_n for asked in commands]
        least, most = min(efforts), max(efforts)
        # One command of another kind makes the sum no number.
        if sum(efforts) != sum(efforts):
            return self._beyond_limit(frame) if phase in CLOSING else None
        return self._answer(frame, least, most) or (
            self._off(frame, 0.5 * (least + most)) if phase == HOLD else None
        )

    def _off(self, frame: Frame, asked_n: float) -> Fault | None:
        """The mean answer in the hold is not the commanded one, though by too little to be dangerous."""
        self._held_n.add(frame.effort_n, frame.dt_s)
        self._asked_n.add(asked_n, frame.dt_s)
        self._held_s += frame.dt_s
        answered_n, asked_n = self._held_n.value, self._asked_n.value
        if self._held_s < OFF_S or not abs(answered_n - asked_n) > max(OFF_N, OFF_SHARE * abs(asked_n)):
            return None
        return Fault(
            "motor off",
            f"it answers {answered_n:.1f} N in the hold to a command of {asked_n:.1f} N, and {100 * OFF_SHARE:.0f} % "
            "are allowed: forces at rest are off by as much; check its supply and its scale",
        )

    def _beyond_limit(self, frame: Frame) -> Fault | None:
        above_n = frame.effort_n - self._allowed_n
        strong = above_n > STRONG_N + STRONG_SHARE * self._allowed_n
        self._strong_s = lasting(self._strong_s, strong, frame.dt_s)
        # A motor that starts takes more for a moment.
        if self._strong_s <= max(OFF_S, self._lasts_s):
            return None
        return Fault(
            "motor too strong",
            f"it answers {frame.effort_n:.1f} N, and its commands allow {self._allowed_n:.1f} N: it ignores the limit, "
            "or the effort is wrong; check both",
            ends=self._strong_s > STRONG_S and above_n > STRONG_N + UNLIMITED_SHARE * self._allowed_n,
        )

    def _answer(self, frame: Frame, least: float, most: float) -> Fault | None:
        answered_n = frame.effort_n
        # Beyond the commands away from zero, short of them, and on the other side of zero.
        above_n = max(answered_n - max(most, 0.0), min(least, 0.0) - answered_n)
        short_n = max(least - answered_n if least > 0.0 else 0.0, answered_n - most if most < 0.0 else 0.0)
        asked_n = max(abs(least), abs(most))
        reverse = (least > ALLOWED_N and answered_n < -ALLOWED_N) or (
            most < -ALLOWED_N and answered_n > ALLOWED_N
        )
        self._reversed_s = lasting(self._reversed_s, reverse, frame.dt_s)
        strong = above_n > ALLOWED_N + ALLOWED_SHARE * asked_n
        self._strong_s = lasting(self._strong_s, strong, frame.dt_s)
        weak = short_n > ALLOWED_N + ALLOWED_SHARE * asked_n
        self._weak_s = lasting(self._weak_s, weak, frame.dt_s)
        if max(self._reversed_s, self._strong_s, self._weak_s) <= self._lasts_s:
            return None  # most ticks end here
        answer = f"it answers {answered_n:.1f} N to a command of {least if least > 0.0 else most:.1f} N"
        if self._reversed_s > self._lasts_s:
            # It can be the effort that is wrong: while the gap does not show that they close, they must open.
            return Fault(REVERSED, f"{answer}: check its wiring, and the sign of its effort", ends=True)
        if self._strong_s > self._lasts_s:
            ends = self._strong_s > STRONG_S or above_n > STRONG_N + STRONG_SHARE * asked_n
            return Fault("motor too strong", f"{answer}: check its drive and its scale", ends=ends)
        ends = self._weak_s > max(WEAK_S, 2.0 * self._lasts_s)
        return Fault("motor too weak", f"{answer}: check its supply and its limits", ends=ends)

    def _wrong_way(self, frame: Frame, phase: int) -> Fault | None:
        """The fingers open while every recent command closes, or close while every one opens."""
        steady = self._direction_t_s <= self._commands[0].t_s
        direction = self._commands[-1].direction if steady else 0
        closes, opens = direction == 1, direction == -1
        if phase != self._phase or not (closes or opens) or self._extreme_m != self._extreme_m:
            self._phase, self._wrong_way_s = phase, 0.0
            self._start_m = self._extreme_m = frame.gap_m
            self._start_m_s = -frame.velocity_m_s
            return None
        allowed_m = WRONG_WAY_M
        if closes:
            self._extreme_m = min(self._extreme_m, frame.gap_m)
            travel_m = frame.gap_m - self._extreme_m
            # Without pads, fingers meet the object in the approach, and a fast or heavy one throws them back.
            rebound_m = REBOUND_SHARE * (self._start_m - self._extreme_m)
            allowed_m = max(allowed_m, min(rebound_m, REBOUND_M))
        else:
            self._extreme_m = max(self._extreme_m, frame.gap_m)
            travel_m = self._extreme_m - frame.gap_m
            if -frame.velocity_m_s < self._start_m_s:
                allowed_m = max(allowed_m, COAST_S * self._start_m_s)
        wrong = travel_m >= allowed_m
        self._wrong_way_s = self._wrong_way_s + frame.dt_s if wrong else 0.0
        # An object that springs back may open fingers that squeeze it.
        if self._wrong_way_s <= self._lasts_s or (closes and phase != APPROACH):
            return None
        commands_no_effort = all(asked.effort_n != asked.effort_n for asked in self._commands)
        closed = closes and self._start_m - self._extreme_m >= FREE_TRAVEL_M and commands_no_effort
        moved, commanded = ("open", "a closing") if closes else ("close", "an opening")
        # Of a motor whose gap has jumped, the motion is no witness: it must still open the fingers.
        if closed or self._gap_jumped:
            return Fault(
                "gap against the command",
                f"it {moved}s by {travel_m * 1e3:.1f} mm under {commanded} command, and has "
                f"{'jumped' if self._gap_jumped else 'closed under it'} before: it is wrong, or something pushes the "
                "fingers; look at the encoder and the fingers",
                ends=True,
            )
        return Fault(
            REVERSED,
            f"the fingers {moved} by {travel_m * 1e3:.1f} mm under {commanded} command: check its wiring",
            ends=True,
            relaxes=True,
        )


class FeltForce:
    """Compares the smaller force of the pads with the largest effort that was allowed so far in the closing.

    The largest one, since fingers whose drive holds by itself press on with it. `pads_hz` is the rate of the forces, 0
    if it is not known. The friction of the drive (N; 0: it is not known) keeps what an impact has pressed; without it,
    only three times the effort ends a grasp.
    """

    def __init__(self, rate_hz: float, pads_hz: float, friction_n: float = 0.0) -> None:
        self._told_s = max(OFF_S, PERIODS / rate_hz, 2.0 / pads_hz if pads_hz > 0.0 else 0.0)
        self._ends_s = max(STRONG_S, self._told_s)
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

        What the mass of fingers that are braked adds for longer is little.
        """
        felt_n, allowed_n = min(frame.force_left_n, frame.force_right_n), self._allowed_n
        rests = abs(frame.velocity_m_s) < RESTS_M_S
        held_n = felt_n - self._friction_n
        more = rests and held_n > (1.0 + ALLOWED_SHARE) * allowed_n + ALLOWED_N
        strong = held_n > (1.0 + STRONG_SHARE) * allowed_n + STRONG_N
        self._more_s = lasting(self._more_s, more, frame.dt_s)
        self._strong_s = lasting(self._strong_s, strong, frame.dt_s)
        if self._more_s <= self._told_s and self._strong_s <= self._ends_s:
            return None
        ends = self._friction_n > 0.0 or held_n > (1.0 + UNLIMITED_SHARE) * allowed_n + STRONG_N
        return Fault(
            "stronger than commanded",
            f"both pads feel {felt_n:.1f} N, and the motor was told {allowed_n:.1f} N at most: check the scale of the "
            "motor, and the calibration of the pads",
            ends=ends and self._strong_s > self._ends_s,
        )


class FreeEffort:
    """Compares the effort of an approach in free air with the friction of the drive (N; 0: it is not known)."""

    def __init__(self, friction_n: float) -> None:
        self._friction_n = friction_n
        self._mean_n = RecentMean(MEAN_S)
        self._travel_m = 0.0

    def see(self, frame: Frame, applied: Command) -> Fault | None:
        """Take the frame of a tick of the approach in which nothing is felt, and the command that is applied."""
        if not self._friction_n > 0.0 or applied.kind != EFFORT or not -frame.velocity_m_s > MOVES_M_S:
            return None
        self._travel_m -= frame.velocity_m_s * frame.dt_s
        self._mean_n.add(asked_effort_n(applied), frame.dt_s)
        mean_n = self._mean_n.value
        if self._travel_m < FREE_TRAVEL_M or not mean_n < EASY_WARNS * self._friction_n:
            return None
        return Fault(
            "moves too easily",
            f"the fingers move with {mean_n:.1f} N, and their friction is {self._friction_n:.1f} N: the motor may "
            "press with more than it reports; check its scale, or measure the friction again (graspsense calibrate "
            "friction)",
            ends=mean_n < EASY_ENDS * self._friction_n,
        )
