"""The forces of both pads against each other: different at rest, or one stands still while the other changes."""

from __future__ import annotations

from math import nan
from typing import Final

from graspsense.core.grasp.protection.motor import RecentMean, lasting
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame, Phase

MEAN_S: Final = 0.1
"""Time over which the forces are averaged, and after which they are compared."""
ALLOWED_N: Final = 2.0
"""Difference that friction can hold: 1.5 N for half a kilogram on a table."""
ALLOWED_SHARE: Final = 1.0 / 3.0
"""Difference that is allowed, as a share of the larger force: calibrations differ."""
STILL_S: Final = 0.25
"""Least time for which the force of a pad stands still."""
IMAGES: Final = 5.0
"""Periods of the pads for which it stands still at least."""
CHANGE_N: Final = 1.0
"""Change of the other pad's force in that time that a sound pad would have felt too."""

EMPTY_SHARE: Final = 0.25
"""Share of the contact force below which a pad holds nothing."""
OPENED_M: Final = 0.005
EMPTY_S: Final = 0.1
"""So much wider than at the contact, and for so long, no object touches both fingers any more."""


class PadBalance:
    """Compares the forces of both pads while the fingers hold."""

    def __init__(self) -> None:
        self._left, self._right = RecentMean(MEAN_S), RecentMean(MEAN_S)
        self._seen_s = 0.0

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick of the hold, and return a difference that no calibration explains."""
        self._left.add(frame.force_left_n, frame.dt_s)
        self._right.add(frame.force_right_n, frame.dt_s)
        self._seen_s += frame.dt_s
        forces = {"left": self._left.value, "right": self._right.value}
        if self._seen_s < MEAN_S or not abs(forces["left"] - forces["right"]) > ALLOWED_N:
            return None
        weak, strong = sorted(forces, key=lambda side: forces[side])
        if forces[strong] - forces[weak] <= ALLOWED_SHARE * forces[strong]:
            return None
        return Fault(
            "pads disagree",
            f"at rest the {weak} pad feels {forces[weak]:.1f} N and the {strong} one {forces[strong]:.1f} N, though "
            "both hold the same object: check the calibration and the cells of both",
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

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick of the squeeze or the hold, and return a pad that it shows to be stuck."""
        forces = (frame.force_left_n, frame.force_right_n)
        for i, side in enumerate(("left", "right")):
            if forces[i] != self._forces[i]:
                self._since[i], self._others[i] = frame.t_s, forces[1 - i]
            elif (
                frame.t_s - self._since[i] >= self._still_s
                and abs(forces[1 - i] - self._others[i]) >= CHANGE_N
                and self._forces[1 - i] == self._forces[1 - i]
            ):
                return Fault(
                    f"{side} pad stuck",
                    f"its force has stood at {forces[i]:.2f} N for {frame.t_s - self._since[i]:.2f} s, while that of "
                    f"the other pad went from {self._others[i]:.2f} to {forces[1 - i]:.2f} N: check its cable",
                    ends=True,
                )
        self._forces = forces
        return None


class EmptyForce:
    """Sees that pads feel a force although the fingers are wider open than where they first felt it.

    No object touches both fingers then: the pads stopped, or their zero has drifted, since the contact. One alone may
    carry a part of an object's weight, and none feels a pull.
    """

    def __init__(self, contact_n: float) -> None:
        self._contact_n = contact_n
        self._contact_gap_m = nan
        self._lasts_s = 0.0

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick; return the fault once it has lasted."""
        least_n, most_n = sorted((frame.force_left_n, frame.force_right_n))
        if phase != Phase.RELEASE:
            if not self._contact_gap_m > 0.0 and least_n > self._contact_n:
                self._contact_gap_m = frame.gap_m
            return None
        felt = abs(least_n) > self._contact_n or most_n > max(self._contact_n, ALLOWED_N)
        open_again = frame.gap_m > self._contact_gap_m + OPENED_M
        self._lasts_s = lasting(self._lasts_s, felt and open_again, frame.dt_s)
        if self._lasts_s <= EMPTY_S:
            return None
        return Fault(
            "pads feel nothing there",
            f"the pads feel {frame.force_left_n:.1f} N (left) and {frame.force_right_n:.1f} N (right) although the "
            "fingers have let go: one stopped, or its zero drifted, in the squeeze, so that its forces are wrong; "
            "check the fingertips",
        )


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
