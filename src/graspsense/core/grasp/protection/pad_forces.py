"""The forces of both pads against each other: different at rest, or one stands still while the other changes."""

from __future__ import annotations

from math import inf, nan
from typing import Final

from graspsense.core.grasp.protection.motor import RecentMean, lasting
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame, Phase

MEAN_S: Final = 0.1
"""Time over which the forces are averaged, and after which they are compared."""
HELD_S: Final = 1.0
"""Time of the hold after which the pads are not compared: the mass of an object that an arm moves presses on one."""
ALLOWED_N: Final = 2.0
"""Difference that friction can hold: 1.5 N for half a kilogram on a table."""
ALLOWED_SHARE: Final = 1.0 / 3.0
"""Difference that is allowed, as a share of the larger force: calibrations differ."""
FREE_SHARE: Final = 0.3
"""Share of the contact force below which a pad is free."""
SCALED_CONTACTS: Final = 0.5
SCALED_SHARE: Final = 0.2
"""Difference that is allowed if it has grown from the contact on, over the contact force, or as a share of the larger
force: features of their mean are then 10 % off. Real pads are not calibrated better."""
LIGHT_SHARE: Final = 0.5
"""Share of the force below which both pads tell what friction held before: a wrong scale differs by less then."""
STILL_S: Final = 0.25
"""Least time for which the force of a pad stands still."""
RESTS_M: Final = 0.0003
"""Travel in that time below which the fingers rest."""
IMAGES: Final = 5.0
"""Periods of the pads for which it stands still at least."""
CHANGE_N: Final = 1.0
"""Change of the other pad's force in that time that a sound pad would have felt too."""

EMPTY_SHARE: Final = 0.25
"""Share of the contact force below which a pad holds nothing."""
EMPTY_S: Final = 0.1
"""Time after which it does."""


class PadBalance:
    """Compares the forces of both pads while the fingers hold.

    Friction holds an object that one finger has pushed, so that this finger feels more throughout; a wrong scale lets
    the difference grow with the force.
    """

    def __init__(self, contact_n: float) -> None:
        self._left, self._right = RecentMean(MEAN_S), RecentMean(MEAN_S)
        self._seen_s = 0.0
        self._scaled_n, self._free_n = SCALED_CONTACTS * contact_n, FREE_SHARE * contact_n
        self._pushed_n = 0.0
        """What the left pad felt more than the right one before both touched (N)."""
        self._light_n, self._held_n = inf, 0.0
        """The least force since both touched, and what the left pad felt more than the right one then (N)."""

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick while the fingers close or hold; return what no friction or calibration explains."""
        if phase == Phase.APPROACH and min(frame.force_left_n, frame.force_right_n) < self._free_n:
            more_n = frame.force_left_n - frame.force_right_n
            self._pushed_n = more_n if more_n == more_n else self._pushed_n
        elif self._free_n <= max(frame.force_left_n, frame.force_right_n) < self._light_n:
            self._light_n = max(frame.force_left_n, frame.force_right_n)
            self._held_n = frame.force_left_n - frame.force_right_n
        if phase != Phase.HOLD:
            return None
        self._left.add(frame.force_left_n, frame.dt_s)
        self._right.add(frame.force_right_n, frame.dt_s)
        self._seen_s += frame.dt_s
        forces = {"left": self._left.value, "right": self._right.value}
        weak, strong = sorted(forces, key=lambda side: forces[side])
        difference_n = forces[strong] - forces[weak]
        light = self._light_n < LIGHT_SHARE * forces[strong]
        before_n = self._held_n if light else self._pushed_n
        grown_n = difference_n - (before_n if strong == "left" else -before_n)
        far = difference_n > max(ALLOWED_N, ALLOWED_SHARE * forces[strong])
        scaled = min(difference_n, grown_n) > max(self._scaled_n, SCALED_SHARE * forces[strong])
        if not MEAN_S <= self._seen_s <= HELD_S or not (far or scaled):
            return None
        return Fault(
            "pads disagree",
            f"at rest the {weak} pad feels {forces[weak]:.1f} N and the {strong} one {forces[strong]:.1f} N, though "
            f"both hold the same object, and {100.0 * SCALED_SHARE:.0f} % are allowed: one has another scale, or lost "
            "its zero; check the cells of both, and calibrate them (graspsense calibrate)",
        )


class StuckForce:
    """Compares the forces of both pads from the contact on; for grippers without noise or without cells too.

    `pads_hz` is the rate of the forces, 0 if it is not known.
    """

    def __init__(self, pads_hz: float) -> None:
        self._still_s = max(STILL_S, IMAGES / pads_hz) if pads_hz > 0.0 else STILL_S
        self._forces = (nan, nan)
        self._since: list[float] = [nan, nan]
        self._others: list[float] = [nan, nan]
        self._gaps_m: list[float] = [nan, nan]

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick of the squeeze or the hold, and return a pad that it shows to be stuck.

        While the fingers rest, it can also be the other one that is wrong.
        """
        forces = (frame.force_left_n, frame.force_right_n)
        for i, side in enumerate(("left", "right")):
            if forces[i] != self._forces[i]:
                self._since[i], self._others[i], self._gaps_m[i] = frame.t_s, forces[1 - i], frame.gap_m
            elif (
                frame.t_s - self._since[i] >= self._still_s
                and abs(forces[1 - i] - self._others[i]) >= CHANGE_N
                and self._forces[1 - i] == self._forces[1 - i]
            ):
                words = (
                    f"its force has stood at {forces[i]:.2f} N for {frame.t_s - self._since[i]:.2f} s, while that of "
                    f"the other pad went from {self._others[i]:.2f} to {forces[1 - i]:.2f} N"
                )
                if abs(frame.gap_m - self._gaps_m[i]) < RESTS_M:
                    words = f"{side} pad: {words}, and the fingers rest: one is stuck, or the other jumps or is late"
                    return Fault("pads disagree", f"{words}; check the cables of both", ends=True)
                return Fault(f"{side} pad stuck", f"{words}: check its cable", ends=True)
        self._forces = forces
        return None


class EmptyHold:
    """Sees that both pads feel nothing while the fingers hold what both have felt."""

    def __init__(self, contact_n: float) -> None:
        self._free_n = EMPTY_SHARE * contact_n
        self._lasts_s = 0.0

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick of the hold; return the fault once it has lasted."""
        felt_n = max(frame.force_left_n, frame.force_right_n)
        self._lasts_s = lasting(self._lasts_s, felt_n < self._free_n, frame.dt_s)
        if self._lasts_s <= EMPTY_S:
            return None
        return Fault(
            "pads feel nothing in the hold",
            f"both felt a contact, and feel {felt_n:.2f} N at most now: the object is gone, or both have stopped; "
            "check the fingertips",
        )
