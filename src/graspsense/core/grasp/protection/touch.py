"""Whether both pads feel what the fingers do: one finger alone, a stalled motor, and a contact in free air.

The fingers press an object that a pad does not feel in three ways. One pad feels and the other does not. The fingers
stop although neither pad feels. Or both pads claim a contact in free air, and the squeeze then starts far from the
object. Each is bounded by a travel of the gap, or by the time that the approach takes for this travel.

An object that does not stand in the middle is felt by one pad first, which pushes it until the other touches too. A
full bottle is pushed by up to 14 mm in the simulated catalogue, with the contact force (`benchmarks/gripper_faults.py
--pushed`). It moves on at the speed of the approach; an object that is pressed does not.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Final

from graspsense.core.control.contact import MOVED_M
from graspsense.core.grasp.protection.motor import RecentMean
from graspsense.core.grasp.protection.pad_forces import FREE_SHARE
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import (
    CLOSING,
    EFFORT,
    FORCE,
    POSITION,
    VELOCITY,
    Command,
    Frame,
    Outcome,
)

TRAVEL_M: Final = 0.003
"""Travel of the gap after which the fingers must have made clear what they touch: 0.3 s at the paper's 10 mm/s."""
SHARP_TRAVEL_M: Final = 0.006
"""Travel after a contact whose force rose in a short one."""
PUSHED_M: Final = 0.015
"""Travel for which one pad may push an object before the other one feels it."""
PUSHED_SHARE: Final = 4.0
"""The force on the pad that pushes an object, over the contact force, above which it presses."""
LEAST_S: Final = 0.1
MOST_S: Final = 3.0
"""Bounds of the time that stands for this travel, for fast and for slow approaches."""
MOST_PUSHED_S: Final = 15.0
"""The longest time for which one pad may push an object."""
CLAIM_PERIODS: Final = 2.0
"""Periods of the pads for which a contact may lack a witness."""
USUAL_M_S: Final = 0.010
"""The speed that is assumed for an approach that has not begun to move: that of the paper."""
STALL_M: Final = 0.0005
"""Travel within which a stalled motor is searched for."""
CLOSED_M: Final = 0.003
"""Gap at which the fingers are closed: what then stands still has nothing between it."""
STALL_SHARE: Final = 0.2
"""Share of the approach speed below which the motor counts as stalled."""
SHARP_M: Final = 0.0015
"""Travel, and the time of the approach for it, in which the force of a pad rises when it touches an object."""
SLOWED_SHARE: Final = 0.7
"""Share of the approach speed below which the fingers have met a resistance."""
SMOOTHING_S: Final = 0.2
"""Time constant of the means of effort and speed over the approach."""
SPEED_SMOOTHING_S: Final = 0.01
SPEED_PERIODS: Final = 10.0
"""Time constant of the present speed, at least so many periods of the frames: several steps of an encoder."""
NEEDED_MARGIN: Final = 1.25
NEEDED_CONTACTS: Final = 2.0
"""By how much the effort may exceed the mean effort of the approach while a contact is not clear: by a quarter, and by
so many times the contact force."""


class Pad:
    """Whether a pad feels a contact: from the contact force on, until its force falls below half of it."""

    def __init__(self, contact_force_n: float) -> None:
        self._contact_n = contact_force_n
        self.felt = False
        self.force_n = nan
        self._free_gap_m = self._free_t_s = self._free_n = nan
        self.first_n = nan
        """The force of the first tick."""
        self.sharp = False
        """Whether the force rose by most of the contact force within a short travel and time, and is there yet."""

    def see(self, force_n: float, frame: Frame, sharp_s: float) -> None:
        """Take the force (N) of this tick, which is not felt if it is NaN. A sharp rise takes at most `sharp_s`."""
        if self.first_n != self.first_n:
            self.first_n = force_n
        if force_n < FREE_SHARE * self._contact_n:
            self._free_gap_m, self._free_t_s, self._free_n = frame.gap_m, frame.t_s, force_n
            self.sharp = False
        elif not self.sharp and force_n - self._free_n >= (1.0 - FREE_SHARE) * self._contact_n:
            travel_m, elapsed_s = self._free_gap_m - frame.gap_m, frame.t_s - self._free_t_s
            self.sharp = travel_m <= SHARP_M and elapsed_s <= sharp_s
        self.force_n = force_n
        self.felt = force_n >= (0.5 * self._contact_n if self.felt else self._contact_n)

    @property
    def presses(self) -> bool:
        """Whether the force is at or above the contact force now."""
        return self.force_n >= self._contact_n


class Touch:
    """Watches both pads against the motion of the fingers, from the approach to the hold.

    `usual_effort_n` limits a contact that is not clear where the approach has shown no effort. `pads_hz` is the rate of
    the forces of the pads, 0 if it is not known, and `rate_hz` that of the frames. `on_some_cells` returns whether both
    forces rose on some cells only.
    """

    def __init__(
        self,
        contact_force_n: float,
        usual_effort_n: float = inf,
        pads_hz: float = 0.0,
        on_some_cells: Callable[[], bool] = lambda: False,
        rate_hz: float = inf,
    ) -> None:
        self._contact_n, self._usual_n = contact_force_n, usual_effort_n
        self._on_some_cells = on_some_cells
        self._images_s = CLAIM_PERIODS / pads_hz if pads_hz > 0.0 else 0.0
        self._left, self._right = Pad(contact_force_n), Pad(contact_force_n)
        self._ever_felt = False
        self._gap_m = nan
        self._needed_n, self._approach_m_s = RecentMean(SMOOTHING_S), RecentMean(SMOOTHING_S)
        self._speed_m_s = RecentMean(max(SPEED_SMOOTHING_S, SPEED_PERIODS / rate_hz))
        self._start_gap_m = nan
        self._alone_t_s = self._alone_gap_m = nan
        self._moved_t_s = self._moved_gap_m = nan
        self._claimed_t_s = self._claimed_gap_m = nan
        self._witnessed = False

    def see(self, frame: Frame, phase: int, asked: Command) -> Fault | None:
        """Take the frame of a tick and the command that the controller asks for; return a fault."""
        if phase not in CLOSING:
            return None
        if self._start_gap_m != self._start_gap_m:
            self._start_gap_m = frame.gap_m
            self._moved_t_s, self._moved_gap_m = frame.t_s, frame.gap_m
        sharp_s = self._allowed_s(SHARP_M)
        self._left.see(frame.force_left_n, frame, sharp_s)
        self._right.see(frame.force_right_n, frame, sharp_s)
        self._ever_felt = self._ever_felt or not self.free()
        velocity_m_s = frame.velocity_m_s
        if velocity_m_s != velocity_m_s and frame.dt_s > 0.0:
            velocity_m_s = (frame.gap_m - self._gap_m) / frame.dt_s
        self._gap_m = frame.gap_m
        self._speed_m_s.add(-velocity_m_s, frame.dt_s)
        self._approached(frame, asked)
        return self._alone(frame) or self._free_air(frame) or self._stalled(frame, asked)

    def closing_limit_n(self) -> float:
        """Return the greatest closing effort (N) in this tick: that of the approach while a contact is not clear."""
        claimed = self._claimed_t_s == self._claimed_t_s and not self._sharp
        if not (claimed or self._alone_t_s == self._alone_t_s):
            return inf
        needed_n = self._needed_n.value
        if needed_n != needed_n:
            return self._usual_n
        return NEEDED_MARGIN * needed_n + NEEDED_CONTACTS * self._contact_n

    @property
    def _sharp(self) -> bool:
        return self._left.sharp or self._right.sharp

    def free(self) -> bool:
        """Whether neither pad feels anything."""
        return not (self._left.felt or self._right.felt)

    def _approached(self, frame: Frame, asked: Command) -> None:
        """Learn the speed and the effort of the approach, while the fingers move and neither pad feels."""
        speed_m_s = self._speed_m_s.value
        mean_m_s = self._approach_m_s.value
        if not self.free() or not self._has_moved(frame) or not speed_m_s > 0.0:
            return
        if mean_m_s == mean_m_s and speed_m_s < SLOWED_SHARE * mean_m_s:
            return
        self._approach_m_s.add(speed_m_s, frame.dt_s)
        # A gripper that controls its speed itself may report the force of its grip, which is nothing in free air.
        if asked.kind in (EFFORT, FORCE):
            self._needed_n.add(max(min(asked.value, asked.effort_limit_n), 0.0), frame.dt_s)

    def _has_moved(self, frame: Frame) -> bool:
        return self._start_gap_m - frame.gap_m >= MOVED_M

    def _allowed_s(self, travel_m: float, most_s: float = MOST_S) -> float:
        """Return the time (s) that the approach takes for this travel, within bounds."""
        speed_m_s = self._approach_m_s.value
        if not speed_m_s > 0.0:
            speed_m_s = USUAL_M_S
        return min(max(travel_m / speed_m_s, LEAST_S), most_s)

    def _alone(self, frame: Frame) -> Fault | None:
        left, right = self._left, self._right
        alone = (left.presses and not right.felt) or (right.presses and not left.felt)
        if not alone:
            if left.felt == right.felt:
                self._alone_t_s = nan
            return None
        if self._alone_t_s != self._alone_t_s:
            self._alone_t_s, self._alone_gap_m = frame.t_s, frame.gap_m
        elapsed_s, travel_m = frame.t_s - self._alone_t_s, self._alone_gap_m - frame.gap_m
        feels, other = ("left", right) if left.presses else ("right", left)
        if not self._presses(frame, (left if left.presses else right).force_n, elapsed_s, travel_m):
            return None
        lacking = "right" if feels == "left" else "left"
        why = "gives no force" if other.force_n != other.force_n else f"reads {other.force_n:.2f} N"
        return Fault(
            f"{feels} finger alone",
            f"the {feels} pad has felt a contact for {elapsed_s:.2f} s and {travel_m * 1e3:.1f} mm, the {lacking} one "
            f"{why}: check the {lacking} fingertip, or place the object between both fingers",
            ends=True,
            outcome=Outcome.ONE_FINGER,
        )

    def _presses(self, frame: Frame, force_n: float, elapsed_s: float, travel_m: float) -> bool:
        """Return whether the pad that feels presses the object, or has pushed it for long enough."""
        if elapsed_s >= self._allowed_s(PUSHED_M, MOST_PUSHED_S) or travel_m >= PUSHED_M:
            return True
        if elapsed_s < self._allowed_s(TRAVEL_M) and travel_m < TRAVEL_M:
            return False
        return self._stands(frame) or force_n >= PUSHED_SHARE * self._contact_n

    def _stands(self, frame: Frame) -> bool:
        """Return whether the fingers have moved by less than a fifth of the approach for some time."""
        elapsed_s = frame.t_s - self._moved_t_s
        return elapsed_s >= max(self._allowed_s(STALL_M / STALL_SHARE), 2.0 * LEAST_S)

    def _free_air(self, frame: Frame) -> Fault | None:
        """A contact that both pads claim has a witness: the force rose on some cells only, the fingers slow down, or it
        goes on rising. One that rose in a short travel may be a zero that has jumped, and is given a longer one.
        """
        if self._witnessed or not (self._left.felt and self._right.felt):
            self._claimed_t_s = nan
            return None
        if self._claimed_t_s != self._claimed_t_s:
            self._claimed_t_s, self._claimed_gap_m = frame.t_s, frame.gap_m
            self._witnessed = self._on_some_cells()
        mean_m_s = self._approach_m_s.value
        slowed = self._speed_m_s.value < SLOWED_SHARE * mean_m_s
        # Over what the pads felt before the fingers closed, which may be no contact.
        risen = any(
            pad.force_n >= max(pad.first_n, self._contact_n) + self._contact_n
            for pad in (self._left, self._right)
        )
        self._witnessed = self._witnessed or slowed or risen
        if self._witnessed:
            self._claimed_t_s = nan
            return None
        elapsed_s, travel_m = frame.t_s - self._claimed_t_s, self._claimed_gap_m - frame.gap_m
        # Fingers that have not approached cannot slow down: they may rest on the object.
        allowed_s = self._allowed_s(TRAVEL_M) if mean_m_s == mean_m_s else inf
        # Of fast fingers, the pads have not told more than the force of the contact within this travel.
        allowed_m = TRAVEL_M
        if self._sharp:
            allowed_s, allowed_m = inf, SHARP_TRAVEL_M
        if (elapsed_s < allowed_s and not travel_m >= allowed_m) or elapsed_s < self._images_s:
            return None
        return Fault(
            "contact in free air",
            f"both pads claim a contact, but the fingers moved on by {travel_m * 1e3:.1f} mm in {elapsed_s:.2f} s "
            "without slowing down, and the force did not rise: the zero of the pads drifts or has jumped; let them "
            "warm up, look at their cables, and try again",
            ends=True,
        )

    def _stalled(self, frame: Frame, asked: Command) -> Fault | None:
        """The fingers moved and stand still now, under a command that closes, and no pad has felt why.

        This does not depend on the phase, which is what the law claims.
        """
        if self._moved_gap_m - frame.gap_m >= STALL_M or not closes(asked, frame, self._needed_n.value):
            self._moved_t_s, self._moved_gap_m = frame.t_s, frame.gap_m
            return None
        # One pad alone, and both of them, have bounds of their own.
        if self._ever_felt or frame.gap_m <= CLOSED_M or not self._has_moved(frame):
            return None
        if not self._stands(frame):
            return None
        return Fault(
            "stalled",
            f"the fingers have stood still for {frame.t_s - self._moved_t_s:.2f} s under a closing command, and the "
            "pads feel nothing: something is in the way that they do not feel; check the fingertips and the drive",
            ends=True,
        )


def closes(asked: Command, frame: Frame, needed_n: float) -> bool:
    """Return whether a command closes the fingers; an effort only from half of that of the approach on."""
    kind, value, _, _ = asked
    if kind in (EFFORT, FORCE):
        return value > 0.0 and not value < 0.5 * needed_n
    if kind == VELOCITY:
        return value < 0.0
    return kind == POSITION and value < frame.gap_m - STALL_M
