"""Whether the motor does what it is commanded: as much, not more, and in the right direction."""

from __future__ import annotations

from collections import deque
from math import nan
from typing import Final

from graspsense.core.faults import Fault
from graspsense.core.signals import APPROACH, EFFORT, Command, Frame, Phase

DELAY_S: Final = 0.03
"""Time within which the motor must follow a command: a command and its answer each take a few ticks."""
ALLOWED_SHARE: Final = 0.25
ALLOWED_N: Final = 1.5
"""By how much the answered effort may differ from the commanded one."""
STRONG_SHARE: Final = 0.5
STRONG_N: Final = 3.0
"""By how much an effort above the command ends the grasp."""
LASTS_S: Final = 0.03
"""Time for which a difference must last to be a fault of the motor."""
STRONG_S: Final = 0.3
"""Time for which a motor may answer somewhat more than its command before the grasp ends."""
WEAK_S: Final = 0.5
"""Time for which a motor may answer less than its command, which crushes nothing, before the grasp ends."""
WRONG_WAY_M: Final = 0.003
"""Travel against the command from which on the motor turns the wrong way round."""

OPENING: Final = int(Phase.OPENING)


def lasting(seconds: float, present: bool, dt_s: float) -> float:
    """Return for how long (s) a difference has been there; it is forgotten at half the rate at which it is gathered.

    A command that the guard switches on and off at a limit of the speed shows a difference in half of the ticks only.
    """
    return seconds + dt_s if present else max(seconds - 0.5 * dt_s, 0.0)


class Motor:
    """Compares the effort that the gripper reports with the commands, and the motion with their direction.

    Only commands of an effort can be compared. `reports_effort` says whether the frames have an effort at all.
    """

    def __init__(self, reports_effort: bool) -> None:
        self._reports_effort = reports_effort
        self._commands: deque[tuple[float, float]] = deque()
        self._strong_s = self._weak_s = self._reversed_s = 0.0
        self._wrong_way_s = 0.0
        self._phase = -1
        self._extreme_m = nan

    def apply(self, t_s: float, command: Command) -> None:
        """Take the command that is applied after the frame of this time."""
        if command.kind != EFFORT:
            self._commands.clear()
        else:
            self._commands.append((t_s, command.value))

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick and return a fault that it shows."""
        commands = self._commands
        while len(commands) > 1 and commands[1][0] <= frame.t_s - DELAY_S:
            commands.popleft()
        if not commands or frame.t_s - commands[0][0] < DELAY_S:
            return None
        values = [value for _, value in commands]
        least, most = min(values), max(values)
        turned = self._wrong_way(frame, phase, least, most)
        if turned is None and self._reports_effort:
            return self._answer(frame, least, most)
        return turned

    def _answer(self, frame: Frame, least: float, most: float) -> Fault | None:
        answered_n = frame.effort_n
        if answered_n != answered_n:
            return None
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
        answer = f"it answers {answered_n:.1f} N to a command of {least if least > 0.0 else most:.1f} N"
        if self._reversed_s > LASTS_S:
            return Fault("motor reversed", f"{answer}: check its wiring", ends=True, relaxes=True)
        if self._strong_s > LASTS_S:
            ends = self._strong_s > STRONG_S or above_n > STRONG_N + STRONG_SHARE * asked_n
            return Fault("motor too strong", f"{answer}: check its drive and its scale", ends=ends)
        if self._weak_s > LASTS_S:
            ends = self._weak_s > WEAK_S
            return Fault("motor too weak", f"{answer}: check its supply and its limits", ends=ends)
        return None

    def _wrong_way(self, frame: Frame, phase: int, least: float, most: float) -> Fault | None:
        """The fingers open while every recent command closes, or close while every one opens."""
        closes, opens = least > ALLOWED_N, most < -ALLOWED_N
        if phase != self._phase or not (closes or opens) or self._extreme_m != self._extreme_m:
            self._phase, self._extreme_m = phase, frame.gap_m
            return None
        if closes:
            self._extreme_m = min(self._extreme_m, frame.gap_m)
            travel_m = frame.gap_m - self._extreme_m
        else:
            self._extreme_m = max(self._extreme_m, frame.gap_m)
            travel_m = self._extreme_m - frame.gap_m
        wrong = travel_m >= WRONG_WAY_M
        self._wrong_way_s = self._wrong_way_s + frame.dt_s if wrong else 0.0
        # An object that springs back may open fingers that squeeze it.
        if self._wrong_way_s <= LASTS_S or (closes and phase != APPROACH):
            return None
        moved, commanded = ("open", "closing") if closes else ("close", "opening")
        return Fault(
            "motor reversed",
            f"the fingers {moved} by {travel_m * 1e3:.1f} mm under a {commanded} command: check its wiring",
            ends=True,
            relaxes=True,
        )
